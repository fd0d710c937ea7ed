// A bot with memory: it keeps the ground and the flag that it has seen, and searches where it has not been.
// It reads a JSON object a line from stdin, and answers each observation with a line on stdout. Debug with console.error.
"use strict";
const readline = require("node:readline");

const STEPS = [[0, 0], [-1, 0], [0, 1], [1, 0], [0, -1]]; // stay, north, east, south, west: down and right
const HIDDEN = -1, OBSTACLE = 8;
let ground, flag; // of the match that runs; each cell is a number, row * side + column

function start({ ruleset }) {
  ground = new Array(ruleset.side ** 2).fill(HIDDEN);
  flag = undefined;
}

/** Return one order for each unit, and what to tell the author. */
function act(seen) {
  const side = seen.ground.length, log = [];
  seen.ground.flat().forEach((code, cell) => {
    if (code !== HIDDEN) ground[cell] = code;
  });
  if (flag === undefined) {
    const cell = ground.indexOf(seen.team === "blue" ? 7 : 6);
    if (cell >= 0) {
      flag = cell;
      log.push(`found the flag at ${Math.floor(cell / side)}, ${cell % side}`);
    }
  }
  const isTheirs = (cell) => cell % side >= side / 2 === (seen.team === "blue");
  const unseen = [...ground.keys()].filter((cell) => ground[cell] === HIDDEN && isTheirs(cell));
  const orders = seen.units.map((unit) => {
    if (flag !== undefined && !unit.flies) return stepTowards([flag], unit, side);
    const own = unseen.filter((cell) => Math.floor(((Math.floor(cell / side) + 0.5) * seen.units.length) / side) === unit.index);
    return stepTowards(own.length ? own : unseen, unit, side);
  });
  return { orders, log };
}

/** Return the first step of a shortest way to the nearest goal; what was never seen counts as open. */
function stepTowards(goals, unit, side) {
  const here = unit.row * side + unit.column;
  const reached = new Set(goals);
  const queue = reached.has(here) ? [] : [...goals];
  for (const cell of queue) {
    for (let order = 1; order <= 4; order++) {
      const row = Math.floor(cell / side) - STEPS[order][0], column = (cell % side) - STEPS[order][1]; // the order leads on
      const before = row * side + column;
      const isFree = row >= 0 && row < side && column >= 0 && column < side && (unit.flies || ground[before] !== OBSTACLE);
      if (isFree && before === here) return order;
      if (isFree && !reached.has(before)) {
        reached.add(before);
        queue.push(before);
      }
    }
  }
  return 0;
}

readline.createInterface({ input: process.stdin }).on("line", (line) => {
  const message = JSON.parse(line);
  if (message.type === "start") start(message);
  if (message.type === "observation") process.stdout.write(JSON.stringify(act(message)) + "\n");
});
