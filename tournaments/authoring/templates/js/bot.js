// A bot without memory: all go for the enemy's flag while one of them sees it; until then, they search the enemy's half.
// It reads a JSON object a line from stdin, and answers each observation with a line on stdout. Debug with console.error.
"use strict";
const readline = require("node:readline");

const STEPS = [[0, 0], [-1, 0], [0, 1], [1, 0], [0, -1]]; // stay, north, east, south, west: down and right
const OBSTACLE = 8;

/** Return one order for each unit. */
function act({ ground, units, team, tick }) {
  const flag = findFlag(ground, team === "blue" ? 7 : 6);
  return units.map((unit) => stepTowards(flag ?? searchGoal(unit, team, tick, ground.length), unit, ground));
}

/** Return [row, column] of a code that is in sight, or undefined. */
function findFlag(ground, code) {
  const row = ground.findIndex((cells) => cells.includes(code));
  return row < 0 ? undefined : [row, ground[row].indexOf(code)];
}

/** Two by two, units go in and out of the enemy's half, further down each time. */
function searchGoal(unit, team, tick, side) {
  const turn = Math.floor(tick / side);
  const lane = Math.floor((Math.floor(unit.index / 2) * side) / 3);
  const row = (lane + Math.floor(side / 6) + Math.floor(turn / 2) * 4) % side;
  const depth = turn % 2 === 0 ? side - 2 : Math.floor(side / 2);
  return [row, team === "blue" ? depth : side - 1 - depth];
}

/** Return the first step of a shortest way around the obstacles in sight; what is out of sight counts as open. */
function stepTowards(goal, unit, ground) {
  const side = ground.length;
  const reached = new Set([goal[0] * side + goal[1]]);
  const queue = unit.row === goal[0] && unit.column === goal[1] ? [] : [goal];
  for (const [row, column] of queue) {
    for (let order = 1; order <= 4; order++) {
      const [r, c] = [row - STEPS[order][0], column - STEPS[order][1]]; // from here, the order leads on
      if (r === unit.row && c === unit.column) return order;
      const isFree = r >= 0 && r < side && c >= 0 && c < side && (unit.flies || ground[r][c] !== OBSTACLE);
      if (isFree && !reached.has(r * side + c)) {
        reached.add(r * side + c);
        queue.push([r, c]);
      }
    }
  }
  return 0;
}

readline.createInterface({ input: process.stdin }).on("line", (line) => {
  const message = JSON.parse(line);
  if (message.type === "observation") process.stdout.write(JSON.stringify(act(message)) + "\n");
});
