// What a board shows of a tick: the scene of a view with those layers that are switched on.
import { CODE, TEAMS } from "./board.js";
import { eventsOf, unitsAt } from "./events.js";

export const TRUTH = "truth";
const TRAIL_TICKS = 12;
const CODES = [[CODE.blueUgv, CODE.blueUav], [CODE.redUgv, CODE.redUav]];

/** Every unit of a tick, blue's first. */
export function everyUnit(tick) {
  return tick.units.flatMap((units, team) => units.map(([row, column, alive], index) => ({ team, index, cell: [row, column], alive })));
}

/**
 * The scene of a view, "blue", "truth" or "red", at a tick.
 *
 * `layers` says what is on: orders, trails, sight, drawings, log, under heat "", a team or "both", and under map the label of the
 * one heat of a bot's that is shown, or "" for all. `pointed` is a cell or null.
 * A view shows of the enemy what its team sees, and that has no numbers and no orders.
 */
export function sceneOf(data, at, view, layers, pointed) {
  const { rules, ticks } = data;
  const tick = ticks[at];
  const { side } = rules;
  const own = TEAMS.indexOf(view);
  const grid = view === TRUTH ? tick.truth : tick.seen[own];
  const isShown = ({ cell: [row, column] }) => grid[row * side + column] !== "?";
  const kindOf = ({ team, index }) => rules.kinds[rules.units[team][index]];
  const units = everyUnit(tick).filter(({ alive, team }) => alive && (view === TRUTH || team === own));
  return {
    grid,
    known: tick.known,
    heats: view === TRUTH ? heatsOf(data, layers.heat) : [],
    sights: layers.sight ? TEAMS.flatMap((team, index) => sightOf(units.filter((unit) => unit.team === index), kindOf, side, team)) : [],
    discs: (pointed ? unitsAt(rules, tick, pointed) : []).map(({ kind }) => ({ cell: pointed, sight: kind.sight, reach: kind.reach })).filter(isShown),
    trails: layers.trails ? units.map((unit) => trailOf(ticks, at, unit)) : [],
    names: new Map(layers.orders ? units.map((unit) => [`${unit.cell[0] * side + unit.cell[1]} ${CODES[unit.team][kindOf(unit).flies ? 1 : 0]}`, `${unit.index}`]) : []),
    arrows: layers.orders && tick.orders ? units.map(({ team, index, cell }) => ({ cell, team: TEAMS[team], action: Number(tick.orders[team][index]) })) : [],
    marks: eventsOf(rules, tick).marks.filter(isShown),
    drawings: layers.drawings && own === (data.noted ?? data.team) ? drawingsOf(tick, layers.map) : [],
  };
}

function sightOf(units, kindOf, side, team) {
  if (!units.length) return [];
  const cells = new Uint8Array(side * side);
  for (const unit of units) {
    const [{ sight }, [row, column]] = [kindOf(unit), unit.cell];
    for (let r = Math.max(0, row - sight); r <= Math.min(side - 1, row + sight); r++) {
      for (let c = Math.max(0, column - sight); c <= Math.min(side - 1, column + sight); c++) {
        if ((r - row) ** 2 + (c - column) ** 2 <= sight ** 2) cells[r * side + c] = 1;
      }
    }
  }
  return [{ cells, team }];
}

function trailOf(ticks, at, { team, index }) {
  const cells = [];
  for (let before = Math.max(0, at - TRAIL_TICKS); before <= at; before++) {
    const [row, column] = ticks[before].units[team][index];
    if (String(cells.at(-1)) !== `${row},${column}`) cells.push([row, column]);
  }
  return { cells, team: TEAMS[team] };
}

const counted = new WeakMap();

/** How often each cell was stood on in the whole match, by team, from 0 to 1; counted anew only where ticks were added. */
function heatsOf(data, chosen) {
  if (!chosen) return [];
  const { side } = data.rules;
  let counts = counted.get(data);
  if (counts?.nTicks !== data.ticks.length) {
    counts = { nTicks: data.ticks.length, levels: [] };
    counts.levels = TEAMS.map((_, team) => {
      const cells = new Float32Array(side * side);
      for (const tick of data.ticks) for (const [row, column, alive] of tick.units[team]) cells[row * side + column] += alive;
      const most = Math.max(...cells, 1);
      return cells.map((n) => Math.sqrt(n / most)); // a cell that was crossed once shows beside one that was held
    });
    counted.set(data, counts);
  }
  return TEAMS.flatMap((team, index) => (chosen === team || chosen === "both" ? [{ levels: counts.levels[index], colour: `unit-${team}` }] : []));
}

/** The labels of all heats that a bot drew, by its colours: a Map, in the order in which they came. */
export function labelsOf({ ticks }) {
  const heats = ticks.flatMap(({ annotations }) => (annotations?.draw ?? []).filter(({ label }) => label));
  return new Map(heats.map(({ label, colour }) => [label, colour]));
}

/** What a bot drew, of its labelled heats only `map` if that is one. Of several heats, a cell shows the strongest: mixed, they are mud. */
function drawingsOf(tick, map) {
  const drawings = (tick.annotations?.draw ?? []).filter(({ label }) => !map || !label || label === map).map(decode);
  const heats = drawings.filter(({ levels }) => levels);
  if (heats.length < 2) return drawings;
  const most = heats[0].levels.map((_, cell) => Math.max(...heats.map(({ levels }) => levels[cell])));
  return drawings.map((one) => (one.levels ? { ...one, levels: one.levels.map((level, cell) => (level < most[cell] ? 0 : level)) } : one));
}

const decoded = new WeakMap();

/** What a bot drew, ready for a board: a heat comes as base64, a byte for each cell. */
function decode(drawing) {
  if (typeof drawing.heat !== "string") return drawing;
  if (!decoded.has(drawing)) decoded.set(drawing, { colour: drawing.colour, levels: Float32Array.from(atob(drawing.heat), (letter) => letter.charCodeAt(0) / 255) });
  return decoded.get(drawing);
}
