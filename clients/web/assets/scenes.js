// What happened between two ticks, read off the units: the page knows no rules, and asks nobody.
import { TEAMS } from "./board.js";

/** The name of a unit, as in "blue UGV 2". */
export function nameOf(rules, team, index) {
  return `${TEAMS[team]} ${rules.units[team][index].toUpperCase()} ${index}`;
}

/** The living units in a cell, as {team, index, kind}. */
export function unitsAt(rules, tick, [row, column]) {
  const found = [];
  tick.units.forEach((units, team) => units.forEach(([r, c, alive], index) => {
    if (alive && r === row && c === column) found.push({ team, index, kind: rules.kinds[rules.units[team][index]] });
  }));
  return found;
}

/** Marks and sentences of the tick at `index`: who fell in it, who stands in a fight, whose flag was captured. */
export function eventsOf(rules, ticks, index, ending) {
  const marks = [];
  const sentences = [];
  const now = ticks[index];
  const before = ticks[index - 1];
  const living = (team) => now.units[team]
    .map(([row, column, alive], unit) => ({ row, column, alive, kind: rules.kinds[rules.units[team][unit]] }))
    .filter((unit) => unit.alive && !unit.kind.flies);
  for (const one of living(0)) {
    for (const other of living(1)) {
      const distance = (one.row - other.row) ** 2 + (one.column - other.column) ** 2;
      for (const [hitter, hit] of [[one, other], [other, one]]) {
        if (rules.attack_at_range ? distance <= hitter.kind.attack ** 2 : distance < hitter.kind.attack ** 2) marks.push({ cell: [hit.row, hit.column], kind: "fight" });
      }
    }
  }
  if (marks.length) sentences.push("a fight is on");
  if (before) {
    now.units.forEach((units, team) => units.forEach(([row, column, alive], unit) => {
      if (!alive && before.units[team][unit][2]) {
        marks.push({ cell: [row, column], kind: "fall" });
        sentences.push(`${nameOf(rules, team, unit)} falls at row ${row}, column ${column}`);
      }
    }));
  }
  if (ending?.ending === "capture" && index === ticks.length - 1) {
    const flags = { 6: 0, 7: 1 };
    const start = ticks[0].truth;
    for (let cell = 0; cell < start.length; cell++) {
      const owner = flags[start[cell]];
      const place = [Math.floor(cell / rules.side), cell % rules.side];
      if (owner !== undefined && living(1 - owner).some((unit) => unit.row === place[0] && unit.column === place[1])) {
        marks.push({ cell: place, kind: "capture" });
        sentences.push(`${TEAMS[1 - owner]} captures the flag at row ${place[0]}, column ${place[1]}`);
      }
    }
  }
  return { marks, sentences };
}
