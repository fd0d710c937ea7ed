// What a tick did, as marks and sentences: the page knows no rules, and shows what it is data.
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

/** Marks and sentences of a tick: who fought in it, who fell, whose flag was captured. */
export function eventsOf(rules, { units, events }) {
  const at = (unit) => units[unit[0]][unit[1]].slice(0, 2);
  const lives = ([team, index]) => units[team][index][2];
  const mark = (those, kind) => those.map((unit) => ({ cell: at(unit), kind }));
  return {
    marks: [...mark(events.fought.filter(lives), "fight"), ...mark(events.fell, "fall"), ...mark(events.captured, "capture")],
    sentences: [
      ...(events.fought.length ? ["a fight is on"] : []),
      ...events.fell.map((unit) => `${nameOf(rules, ...unit)} falls at row ${at(unit)[0]}, column ${at(unit)[1]}`),
      ...events.captured.map((unit) => `${TEAMS[unit[0]]} captures the flag at row ${at(unit)[0]}, column ${at(unit)[1]}`),
    ],
  };
}

/** What stands on the timeline, as {at, kind, title}: fights as they begin, and all who fall or capture; at most one of a tick. */
export function milestonesOf({ rules, ticks }) {
  return ticks.flatMap((tick, at) => {
    const { fought, fell, captured } = tick.events;
    const begins = fought.length && !ticks[at - 1]?.events.fought.length;
    const kind = captured.length ? "capture" : fell.length ? "fall" : begins ? "fight" : null;
    return kind ? [{ at, kind, title: `tick ${tick.tick}: ${kind === "fight" ? "a fight begins" : eventsOf(rules, tick).sentences.slice(fought.length ? 1 : 0).join("; ")}` }] : [];
  });
}
