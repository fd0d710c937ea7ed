// Plays ticks on two boards: a timeline to scrub, step and play, by pointer and by keys.
import { Board, TEAMS } from "./board.js";
import { h, setText } from "./dom.js";
import { eventsOf, nameOf, unitsAt } from "./events.js";

const SPEEDS = [1, 2, 4, 8, 15, 30, 60];

export class Player {
  /** `data` as the server tells a match; `onTick` hears each tick that is shown. */
  constructor(stage, data, onTick) {
    this.data = data;
    this.onTick = onTick;
    this.at = -1;
    this.team = 0;
    this.speed = 8;
    this.isPlaying = false;
    this.isWhole = false; // a replay, to which nothing is added
    this.hovered = null;
    this.followed = null;
    this.boards = ["what blue sees", "the truth"].map((label) => new Board(data.rules, label));
    this.build(stage);
    this.onKey = (event) => this.press(event);
    document.addEventListener("keydown", this.onKey);
  }

  build(stage) {
    this.teamButtons = TEAMS.map((team, index) =>
      h("button", { type: "button", "aria-pressed": `${index === 0}`, onclick: () => this.choose(index) }, team));
    this.timeline = h("input", { type: "range", class: "timeline", min: 0, max: 0, value: 0, "aria-label": "Tick", oninput: () => { this.pause(); this.go(Number(this.timeline.value)); } });
    this.playButton = h("button", { type: "button", class: "main", onclick: () => this.toggle() }, "Play");
    this.pace = h("select", { "aria-label": "Ticks per second", onchange: () => { this.speed = Number(this.pace.value); } },
      SPEEDS.map((speed) => h("option", { value: speed, selected: speed === this.speed }, `${speed} ticks/s`)));
    this.tickSays = h("output", { class: "number" });
    this.events = h("p", { class: "events", role: "status" });
    this.rows = h("tbody");
    const step = (text, label, by) => h("button", { type: "button", "aria-label": label, onclick: () => this.step(by) }, text);
    const seen = h("figure", {}, h("figcaption", {}, (this.caption = h("span", {}, "What blue sees")), h("span", { class: "controls" }, this.teamButtons)), this.boards[0].canvas);
    const truth = h("figure", {}, h("figcaption", {}, h("span", {}, "The truth")), this.boards[1].canvas);
    stage.append(
      h("div", { class: "controls" }, this.playButton, step("\u25c0", "One tick back", -1), step("\u25b6", "One tick on", 1), this.timeline, this.tickSays, this.pace),
      this.events,
      h("div", { class: "boards" }, seen, truth),
      h("p", { class: "legend" }, ...["U u UGV", "A a UAV", "pennant: flag", "grey: obstacle", "hatched: fog", "frame: in a fight", "cross: fell", "ring: flag captured"].map((text) => h("span", {}, text))),
      h("p", { class: "hint" }, "Capitals are blue's, small letters red's. Point at a unit, or go to it in the table, for its sight and attack. Keys: ",
        ...[["Space", "play"], ["\u2190 \u2192", "step"], ["Home End", "ends"], ["+ \u2212", "speed"], ["T", "team"]].flatMap(([key, what]) => [h("kbd", {}, key), ` ${what} `])),
      h("details", {}, h("summary", {}, "Units as a table"), h("div", { class: "scroll" }, h("table", { "aria-label": "Units" },
        h("thead", {}, h("tr", {}, ...["Unit", "Row", "Column", "State"].map((name) => h("th", { scope: "col" }, name)))), this.rows))));
    for (const board of this.boards) {
      board.canvas.addEventListener("pointermove", (event) => this.hover(board.cellAt(event.clientX, event.clientY)));
      board.canvas.addEventListener("pointerdown", (event) => this.hover(board.cellAt(event.clientX, event.clientY)));
      board.canvas.addEventListener("pointerleave", () => this.hover(null));
    }
  }

  /** Add a tick of a match that runs; the page follows unless it looks at an earlier one. */
  add(tick) {
    const { ticks } = this.data;
    const last = ticks.at(-1)?.tick ?? -1;
    if (tick.tick <= last) return;
    const follows = this.at === ticks.length - 1;
    ticks.push(tick);
    this.timeline.max = ticks.length - 1;
    if (follows) this.go(ticks.length - 1);
  }

  go(index) {
    const { ticks } = this.data;
    this.timeline.max = ticks.length - 1;
    this.at = Math.max(0, Math.min(index, ticks.length - 1));
    this.timeline.value = this.at;
    this.draw();
    this.onTick(ticks[this.at]);
  }

  step(by) {
    this.pause();
    this.go(this.at + by);
  }

  choose(team) {
    this.team = team;
    this.teamButtons.forEach((button, index) => button.setAttribute("aria-pressed", index === team));
    setText(this.caption, `What ${TEAMS[team]} sees`);
    this.draw();
  }

  toggle() {
    if (this.isPlaying) {
      this.pause();
      return;
    }
    if (this.at >= this.data.ticks.length - 1) this.go(0);
    this.isPlaying = true;
    setText(this.playButton, "Pause");
    this.events.setAttribute("aria-live", "off"); // nobody can listen to sixty sentences a second
    let due = performance.now();
    const run = (now) => {
      if (!this.isPlaying) return;
      const n = Math.floor(((now - due) * this.speed) / 1000);
      if (n > 0) {
        due += (n * 1000) / this.speed;
        this.go(this.at + n);
      }
      if (this.at >= this.data.ticks.length - 1) this.pause();
      else requestAnimationFrame(run);
    };
    requestAnimationFrame(run);
  }

  pause() {
    this.isPlaying = false;
    setText(this.playButton, "Play");
    this.events.setAttribute("aria-live", "polite");
    if (this.at >= 0) this.fillTable();
  }

  stop() {
    this.isPlaying = false;
    document.removeEventListener("keydown", this.onKey);
  }

  hover(cell) {
    if (String(cell) === String(this.hovered)) return;
    this.hovered = cell;
    if (this.at >= 0) this.draw();
  }

  /** Show what a unit can do wherever it goes, until another is followed; null for none. */
  follow(number) {
    this.followed = number;
    this.draw();
  }

  press(event) {
    if (event.ctrlKey || event.metaKey || event.altKey || event.target.closest("input:not([type=range]), select, textarea")) return;
    const isButton = event.target.closest("button, summary, a") !== null;
    const keys = {
      " ": () => this.toggle(),
      ArrowLeft: () => this.step(-1),
      ArrowRight: () => this.step(1),
      Home: () => this.step(-this.data.ticks.length),
      End: () => this.step(this.data.ticks.length),
      "+": () => this.shift(1),
      "-": () => this.shift(-1),
      t: () => this.choose(1 - this.team),
    };
    if (!keys[event.key] || (isButton && event.key === " ")) return;
    event.preventDefault();
    keys[event.key]();
  }

  shift(by) {
    this.speed = SPEEDS[Math.max(0, Math.min(SPEEDS.indexOf(this.speed) + by, SPEEDS.length - 1))];
    this.pace.value = this.speed;
  }

  draw() {
    const { rules, ticks } = this.data;
    const tick = ticks[this.at];
    if (!tick) return;
    const { marks, sentences } = eventsOf(rules, tick);
    const cell = this.hovered ?? (this.followed === null ? null : this.units(tick)[this.followed].cell);
    const units = cell ? unitsAt(rules, tick, cell) : [];
    const discs = units.map(({ kind }) => ({ cell, sight: kind.sight, attack: kind.attack }));
    const isSeen = ({ cell: [row, column] }) => tick.seen[this.team][row * rules.side + column] !== "?";
    this.boards[0].show({ grid: tick.seen[this.team], marks: marks.filter(isSeen), discs: discs.filter(isSeen) });
    this.boards[1].show({ grid: tick.truth, marks, discs });
    this.boards[0].label(`What ${TEAMS[this.team]} sees at tick ${tick.tick}`);
    this.boards[1].label(`The truth at tick ${tick.tick}: blue has ${tick.living[0]} units, red ${tick.living[1]}`);
    setText(this.tickSays, `${tick.tick} / ${ticks.at(-1).tick}`);
    const pointed = units.map(({ team, index, kind }) => `${nameOf(rules, team, index)}: sight ${kind.sight}, attack ${kind.attack}, step ${kind.step}`);
    setText(this.events, [...pointed, ...sentences].join("; "));
    if (!this.isPlaying) this.fillTable();
  }

  /** Every unit of a tick, blue's first. */
  units(tick) {
    return tick.units.flatMap((units, team) => units.map(([row, column, alive], index) => ({ team, index, cell: [row, column], alive })));
  }

  /** Each unit is a button, which shows by keyboard what pointing at the unit shows. Rows stay, so that focus does. */
  fillTable() {
    const { rules, ticks } = this.data;
    const units = this.units(ticks[this.at]);
    if (!this.rows.children.length) {
      this.rows.append(...units.map(({ team, index }, number) => h("tr", {},
        h("th", { scope: "row", class: TEAMS[team] }, h("button", { type: "button", onfocus: () => this.follow(number), onblur: () => this.follow(null) }, nameOf(rules, team, index))),
        h("td", { class: "number" }), h("td", { class: "number" }), h("td"))));
    }
    units.forEach(({ cell: [row, column], alive }, number) => {
      [`${row}`, `${column}`, alive ? "lives" : "fallen"].forEach((text, at) => setText(this.rows.children[number].cells[at + 1], text));
    });
  }
}
