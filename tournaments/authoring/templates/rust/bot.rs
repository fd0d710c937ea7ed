//! A bot without memory: all go for the enemy's flag while one of them sees it; until then, they search the enemy's half.
//! It reads a JSON object a line from stdin, and answers each observation with a line on stdout. Debug with eprintln!.

mod board;
mod json;

use board::{step_towards, Seen};
use json::Json;
use std::io::{stdin, BufRead};

fn act(seen: &Seen) -> Vec<usize> {
    let flag = seen.find_flag(&seen.ground);
    let goal_of = |index: usize| flag.unwrap_or_else(|| search_goal(index, seen));
    let units = seen.units.iter().enumerate();
    units.map(|(index, unit)| step_towards(&[goal_of(index)], unit, &seen.ground, seen.side)).collect()
}

/// Two by two, units go in and out of the enemy's half, further down each time.
fn search_goal(index: usize, seen: &Seen) -> usize {
    let (side, turn) = (seen.side, seen.tick / seen.side);
    let row = (index / 2 * side / 3 + side / 6 + turn / 2 * 4) % side;
    let depth = if turn % 2 == 0 { side - 2 } else { side / 2 };
    row * side + if seen.is_blue { depth } else { side - 1 - depth }
}

fn main() {
    for line in stdin().lock().lines().map_while(Result::ok) {
        let Some(message) = Json::read(&line) else { continue };
        if message.get("type").text() == "observation" {
            println!("{:?}", act(&Seen::read(&message)));
        }
    }
}
