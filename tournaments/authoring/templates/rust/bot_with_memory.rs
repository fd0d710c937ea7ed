//! A bot with memory: it keeps the ground and the flag that it has seen, and searches where it has not been.
//! It reads a JSON object a line from stdin, and answers each observation with a line on stdout. Debug with eprintln!.

mod board;
mod json;

use board::{step_towards, Seen, HIDDEN};
use json::Json;
use std::io::{stdin, BufRead};

/// What is kept of one match.
#[derive(Default)]
struct Memory {
    ground: Vec<i64>,
    flag: Option<usize>,
}

impl Memory {
    /// Return one order for each unit, and what to tell the author.
    fn act(&mut self, seen: &Seen) -> (Vec<usize>, String) {
        self.ground.resize(seen.ground.len(), HIDDEN);
        for (kept, &shown) in self.ground.iter_mut().zip(&seen.ground) {
            if shown != HIDDEN {
                *kept = shown;
            }
        }
        let mut log = String::new();
        if self.flag.is_none() {
            self.flag = seen.find_flag(&self.ground);
            if let Some(flag) = self.flag {
                log = format!("\"found the flag at {}, {}\"", flag / seen.side, flag % seen.side);
            }
        }
        let unseen = self.find_unseen(seen);
        let mut orders = Vec::new();
        for (index, unit) in seen.units.iter().enumerate() {
            let is_own = |cell: &usize| cell / seen.side * seen.units.len() / seen.side == index;
            let own: Vec<usize> = unseen.iter().copied().filter(is_own).collect();
            let goals = match self.flag {
                Some(flag) if !unit.flies => vec![flag],
                _ if own.is_empty() => unseen.clone(),
                _ => own,
            };
            orders.push(step_towards(&goals, unit, &self.ground, seen.side));
        }
        (orders, log)
    }

    /// The cells of the enemy's half that nobody has seen.
    fn find_unseen(&self, seen: &Seen) -> Vec<usize> {
        let is_theirs = |cell: &usize| (cell % seen.side >= seen.side / 2) == seen.is_blue;
        (0..self.ground.len()).filter(|&cell| self.ground[cell] == HIDDEN).filter(is_theirs).collect()
    }
}

fn main() {
    let mut memory = Memory::default();
    for line in stdin().lock().lines().map_while(Result::ok) {
        let Some(message) = Json::read(&line) else { continue };
        match message.get("type").text() {
            "start" => memory = Memory::default(),
            "observation" => {
                let (orders, log) = memory.act(&Seen::read(&message));
                println!("{{\"orders\": {orders:?}, \"log\": [{log}]}}");
            }
            _ => {}
        }
    }
}
