// Plays ticks on the boards of both teams and of the truth: scrubbed, stepped and played, by pointer and by keys.
import { Board, TEAMS } from "./board.js";
import { h, setText } from "./dom.js";
import { eventsOf, nameOf, unitsAt } from "./events.js";
import { KeysDialog, Legend } from "./legend.js";
import { everyUnit, labelsOf, sceneOf, TRUTH } from "./scene.js";
import { Timeline } from "./timeline.js";

const SPEEDS = [1, 2, 4, 8, 15, 30, 60];
const ORDERS = ["stay", "north", "east", "south", "west"];
const HEATS = ["", "blue", "red", "both"];
/** From here on all boards stand side by side; `player.css` says the same. */
const WIDE = matchMedia("(min-width: 900px)");
const ALL = "all";
const SWITCHES = { orders: ["o", "Numbers and orders"], trails: ["t", "Trails"], sight: ["s", "Sight"], drawings: ["d", "Drawings"], log: ["l", "Log"] };
const KEYS = [
  ["Space", "play or pause"], ["\u2190 \u2192", "a tick back or on"], ["\u2191 \u2193 or Home End", "to the start or the end"], ["+ \u2212", "faster or slower"],
  ["N P", "to the next event, or the one before"], ["F", "the next view"], ["O", "numbers and orders"], ["T", "trails"], ["S", "what is in sight"],
  ["H", "where units went"], ["?", "these keys"],
];
const BOT_KEYS = [["D", "the bot's drawings"], ["L", "the bot's log"]];
const MAP_KEYS = [["M", "the bot's heat maps, one by one"]];

export class Player {
  /**
   * `data` as the server tells a match; of a transcript, with its `team`. `onTick` hears each tick that is shown, and `onMove`
   * when a person went elsewhere, or plays no longer. `view` is which boards are to be seen: "blue", "truth", "red", "all", or ""
   * for what there is room for.
   */
  constructor(stage, data, { onTick, onMove = () => {}, view = "" }) {
    this.data = data;
    this.onTick = onTick;
    this.onMove = onMove;
    this.at = -1;
    this.speed = 8;
    this.isPlaying = false;
    this.isWhole = false; // a replay, to which nothing is added
    this.hovered = null;
    this.followed = null;
    this.isOfBot = data.ticks.some(({ annotations }) => annotations?.log.length || annotations?.draw.length);
    this.labels = labelsOf(data);
    this.layers = { orders: true, trails: false, sight: false, heat: "", drawings: true, log: true, map: "" };
    this.views = data.team === undefined ? [TEAMS[0], TRUTH, TEAMS[1]] : [TEAMS[data.team]];
    this.chosen = [...this.views, ALL].includes(view) ? view : "";
    this.boards = this.views.map((name) => new Board(data.rules, name));
    this.build(stage);
    this.onKey = (event) => this.press(event);
    this.onWidth = () => this.showViews();
    document.addEventListener("keydown", this.onKey);
    WIDE.addEventListener("change", this.onWidth);
  }

  build(stage) {
    const button = (text, label, onclick, properties = {}) => h("button", { type: "button", "aria-label": label, title: label, onclick, ...properties }, text);
    this.timeline = new Timeline((at) => this.jump(at));
    this.playButton = h("button", { type: "button", class: "main", onclick: () => this.toggle() }, "Play");
    this.pace = h("select", { "aria-label": "Ticks per second", onchange: () => { this.speed = Number(this.pace.value); } },
      SPEEDS.map((speed) => h("option", { value: speed, selected: speed === this.speed }, `${speed} ticks/s`)));
    this.tickSays = h("output", { class: "number" });
    this.events = h("p", { class: "events", role: "status" });
    this.rows = h("tbody");
    this.viewButtons = (this.views.length > 1 ? [...this.views, ALL] : []).map((name) =>
      h("button", { type: "button", class: name, onclick: () => this.choose(name) }, name === TRUTH ? "truth" : name));
    this.switches = Object.entries(SWITCHES).filter(([name]) => this.isOfBot || !["drawings", "log"].includes(name)).map(([name, [key, label]]) =>
      h("button", { type: "button", title: `${label} (${key.toUpperCase()})`, onclick: () => this.switch(name) }, label));
    this.heat = this.views.includes(TRUTH) ? h("select", { "aria-label": "Where units went", onchange: () => this.warm(this.heat.value) },
      HEATS.map((team) => h("option", { value: team }, team ? `Where ${team === "both" ? "both" : team} went` : "No heat map"))) : null;
    this.maps = this.labels.size ? h("select", { "aria-label": "The bot's heat maps", onchange: () => this.chart(this.maps.value) },
      h("option", { value: "" }, "All its maps"), [...this.labels].map(([label, colour]) => h("option", { value: label }, `${label} (${colour})`))) : null;
    this.log = h("ol", { class: "log", "aria-label": "The bot's log" });
    this.keys = new KeysDialog([...KEYS, ...(this.isOfBot ? BOT_KEYS : []), ...(this.maps ? MAP_KEYS : [])]);
    this.figures = this.boards.map((board, index) => h("figure", {}, h("figcaption", {}, this.captionOf(this.views[index])), board.canvas));
    this.boardRow = h("div", { class: "boards" }, this.figures);
    stage.append(
      this.viewButtons.length ? h("div", { class: "controls views", role: "group", "aria-label": "View" }, this.viewButtons) : "",
      this.boardRow,
      this.timeline.element,
      h("div", { class: "controls transport" }, this.playButton,
        button("\u21e4", "To the event before", () => this.seek(-1)), button("\u25c0", "One tick back", () => this.step(-1)),
        button("\u25b6", "One tick on", () => this.step(1)), button("\u21e5", "To the next event", () => this.seek(1)),
        this.tickSays, this.pace, button("?", "Keys", () => this.keys.toggle(), { class: "keys" })),
      this.events,
      h("div", { class: "controls layers", role: "group", "aria-label": "Shown on the boards" }, this.switches, this.maps, this.heat),
      new Legend(this.isOfBot).element,
      h("details", {}, h("summary", {}, "Units as a table"), h("div", { class: "scroll" }, h("table", { "aria-label": "Units" },
        h("thead", {}, h("tr", {}, ...["Unit", "Row", "Column", "State", "Order"].map((name) => h("th", { scope: "col" }, name)))), this.rows))),
      this.keys.element);
    for (const board of this.boards) {
      board.canvas.addEventListener("pointermove", (event) => this.hover(board.cellAt(event.clientX, event.clientY)));
      board.canvas.addEventListener("pointerdown", (event) => this.hover(board.cellAt(event.clientX, event.clientY)));
      board.canvas.addEventListener("pointerleave", () => this.hover(null));
    }
    this.showSwitches();
    this.showViews();
  }

  captionOf(view) {
    return view === TRUTH ? "The truth" : `What ${view} sees`;
  }

  /** Which boards are seen: where there is no room for all, one. */
  get view() {
    if (this.views.length === 1) return this.views[0];
    return this.chosen && (this.chosen !== ALL || WIDE.matches) ? this.chosen : WIDE.matches ? ALL : TRUTH;
  }

  showViews() {
    const { view } = this;
    this.figures.forEach((figure, index) => { figure.hidden = view !== ALL && this.views[index] !== view; });
    this.boardRow.classList.toggle("one", view !== ALL);
    if (this.isOfBot && WIDE.matches) this.boardRow.append(this.log);
    else if (this.isOfBot) this.events.after(this.log); // so that board and timeline are seen at once
    this.viewButtons.forEach((button) => button.setAttribute("aria-pressed", `${button.classList.contains(view)}`));
    this.draw();
  }

  choose(view) {
    this.chosen = view;
    this.showViews();
    this.onMove();
  }

  /** Go to the view behind this one, as there is room. */
  flip() {
    const names = WIDE.matches ? [...this.views, ALL] : this.views;
    if (this.views.length > 1) this.choose(names[(names.indexOf(this.view) + 1) % names.length]);
  }

  switch(name) {
    this.layers[name] = !this.layers[name];
    this.showSwitches();
    this.draw();
  }

  warm(team) {
    this.layers.heat = team;
    if (this.heat) this.heat.value = team;
    this.draw();
  }

  /** Show one heat of the bot's alone, by its label, or all. */
  chart(label) {
    this.layers.map = label;
    this.maps.value = label;
    this.draw();
  }

  showSwitches() {
    const names = Object.keys(SWITCHES);
    this.switches.forEach((button, index) => button.setAttribute("aria-pressed", `${this.layers[names[index]]}`));
    this.log.hidden = !this.layers.log;
  }

  /** Add a tick of a match that runs; the page follows unless it looks at an earlier one. */
  add(tick) {
    const { ticks } = this.data;
    const last = ticks.at(-1)?.tick ?? -1;
    if (tick.tick <= last) return;
    const follows = this.at === ticks.length - 1;
    ticks.push(tick);
    this.timeline.measure(this.data);
    if (follows) this.go(ticks.length - 1);
  }

  go(index) {
    const { ticks } = this.data;
    this.timeline.measure(this.data);
    this.at = Math.max(0, Math.min(index, ticks.length - 1));
    this.timeline.slider.value = this.at;
    this.draw();
    this.onTick(ticks[this.at]);
  }

  /** Go to a tick, and stay there. */
  jump(index) {
    this.pause();
    this.go(index);
    this.onMove();
  }

  step(by) {
    this.jump(this.at + by);
  }

  seek(by) {
    const at = this.timeline.find(this.at, by);
    if (at !== null) this.jump(at);
  }

  toggle() {
    if (this.isPlaying) {
      this.pause();
      this.onMove();
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
      if (this.at < this.data.ticks.length - 1) {
        requestAnimationFrame(run);
        return;
      }
      this.pause();
      this.onMove();
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
    WIDE.removeEventListener("change", this.onWidth);
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
    const last = this.data.ticks.length;
    const keys = {
      " ": () => this.toggle(),
      ArrowLeft: () => this.step(-1),
      ArrowRight: () => this.step(1),
      ArrowUp: () => this.jump(0),
      ArrowDown: () => this.jump(last),
      Home: () => this.jump(0),
      End: () => this.jump(last),
      "+": () => this.shift(1),
      "=": () => this.shift(1), // where + needs Shift
      "-": () => this.shift(-1),
      n: () => this.seek(1),
      p: () => this.seek(-1),
      f: () => this.flip(),
      h: () => this.heat && this.warm(HEATS[(HEATS.indexOf(this.layers.heat) + 1) % HEATS.length]),
      "?": () => this.keys.toggle(),
    };
    const labels = ["", ...this.labels.keys()];
    if (this.maps) keys.m = () => this.chart(labels[(labels.indexOf(this.layers.map) + 1) % labels.length]);
    for (const [name, [letter]] of Object.entries(SWITCHES)) keys[letter] = () => this.switch(name);
    const key = event.key.length === 1 ? event.key.toLowerCase() : event.key;
    if (!keys[key] || (isButton && key === " ") || (this.keys.element.open && key !== "?")) return;
    event.preventDefault();
    keys[key]();
  }

  shift(by) {
    this.speed = SPEEDS[Math.max(0, Math.min(SPEEDS.indexOf(this.speed) + by, SPEEDS.length - 1))];
    this.pace.value = this.speed;
  }

  draw() {
    const { rules, ticks } = this.data;
    const tick = ticks[this.at];
    if (!tick) return;
    const followed = this.followed === null ? null : everyUnit(tick)[this.followed].cell;
    const cell = this.hovered ?? followed;
    this.boards.forEach((board, index) => {
      const view = this.views[index];
      if (this.figures[index].hidden) return;
      board.show(sceneOf(this.data, this.at, view, this.layers, cell));
      board.label(`${this.captionOf(view)} at tick ${tick.tick}${view === TRUTH ? `: blue has ${tick.living[0]} units, red ${tick.living[1]}` : ""}`);
    });
    setText(this.tickSays, `${tick.tick} / ${ticks.at(-1).tick}`);
    const pointed = (cell ? unitsAt(rules, tick, cell) : []).map(({ team, index, kind }) => `${nameOf(rules, team, index)}: sight ${kind.sight}, attack ${kind.attack}, step ${kind.step}`);
    setText(this.events, [...pointed, ...eventsOf(rules, tick).sentences].join("; "));
    if (this.isOfBot) this.log.replaceChildren(...(tick.annotations?.log ?? []).map((line) => h("li", {}, line)));
    if (!this.isPlaying) this.fillTable();
  }

  /** Each unit is a button, which shows by keyboard what pointing at the unit shows. Rows stay, so that focus does. */
  fillTable() {
    const { rules, ticks } = this.data;
    const tick = ticks[this.at];
    const units = everyUnit(tick);
    if (!this.rows.children.length) {
      this.rows.append(...units.map(({ team, index }, number) => h("tr", {},
        h("th", { scope: "row", class: TEAMS[team] }, h("button", { type: "button", onfocus: () => this.follow(number), onblur: () => this.follow(null) }, nameOf(rules, team, index))),
        h("td", { class: "number" }), h("td", { class: "number" }), h("td"), h("td"))));
    }
    units.forEach(({ team, index, cell: [row, column], alive }, number) => {
      const order = alive && tick.orders ? ORDERS[tick.orders[team][index]] : "";
      [`${row}`, `${column}`, alive ? "lives" : "fallen", order].forEach((text, at) => setText(this.rows.children[number].cells[at + 1], text));
    });
  }
}
