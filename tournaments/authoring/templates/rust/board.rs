//! What the arena tells a program, and the way to a cell. A cell is a number, row * side + column.

#![allow(dead_code)] // each bot uses a part of it
use crate::json::Json;
use std::collections::VecDeque;

pub const HIDDEN: i64 = -1;
const BLUE_FLAG: i64 = 6;
const RED_FLAG: i64 = 7;
const OBSTACLE: i64 = 8;
const STEPS: [(i64, i64); 5] = [(0, 0), (-1, 0), (0, 1), (1, 0), (0, -1)]; // stay, north, east, south, west: down and right

pub struct Unit {
    pub cell: usize,
    pub flies: bool,
}

pub struct Seen {
    pub is_blue: bool,
    pub tick: usize,
    pub side: usize,
    pub ground: Vec<i64>,
    pub units: Vec<Unit>,
}

impl Seen {
    pub fn read(message: &Json) -> Seen {
        let side = message.get("ground").items().len();
        let cell_of = |unit: &Json| unit.get("row").int() as usize * side + unit.get("column").int() as usize;
        let units = message.get("units").items().iter();
        Seen {
            is_blue: message.get("team").text() == "blue",
            tick: message.get("tick").int() as usize,
            side,
            ground: message.get("ground").items().iter().flat_map(|row| row.items().iter().map(Json::int)).collect(),
            units: units.map(|unit| Unit { cell: cell_of(unit), flies: unit.get("flies").is_true() }).collect(),
        }
    }

    /// The cell of the enemy's flag, if it is on this ground.
    pub fn find_flag(&self, ground: &[i64]) -> Option<usize> {
        let code = if self.is_blue { RED_FLAG } else { BLUE_FLAG };
        ground.iter().position(|&shown| shown == code)
    }
}

/// The first step of a shortest way to the nearest goal, around obstacles; what is hidden counts as open.
pub fn step_towards(goals: &[usize], unit: &Unit, ground: &[i64], side: usize) -> usize {
    let mut is_reached = vec![false; ground.len()];
    let mut queue: VecDeque<usize> = goals.iter().copied().collect();
    for &goal in goals {
        is_reached[goal] = true;
    }
    if is_reached[unit.cell] {
        return 0;
    }
    let board = 0..side as i64;
    while let Some(cell) = queue.pop_front() {
        for (order, (down, right)) in STEPS.iter().enumerate().skip(1) {
            let (row, column) = ((cell / side) as i64 - down, (cell % side) as i64 - right); // from here, the order leads on
            if !board.contains(&row) || !board.contains(&column) {
                continue;
            }
            let before = row as usize * side + column as usize;
            if before == unit.cell {
                return order;
            }
            if !is_reached[before] && (unit.flies || ground[before] != OBSTACLE) {
                is_reached[before] = true;
                queue.push_back(before);
            }
        }
    }
    0
}
