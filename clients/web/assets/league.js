// The leaderboards of the store, live: of leagues, ratings with their intervals, the cross table, and every replay; of ladders, the ratings.
import { ask, fill, h, route, setText, signed } from "./dom.js";
import { address, describe, formatScore } from "./head_to_head.js";

const EVERY_MS = 5000;
const WIDEST_PLOT = 760;
const SVG = "http://www.w3.org/2000/svg";

/** About `n` round numbers between two. */
function roundNumbers(low, high, n) {
  const least = (high - low) / n || 1;
  const power = 10 ** Math.floor(Math.log10(least));
  const step = power * [1, 2, 5, 10].find((factor) => factor * power >= least);
  return Array.from({ length: Math.floor((high - low) / step) + 1 }, (_, index) => (Math.ceil(low / step) + index) * step + 0).filter((one) => one <= high);
}

export function show(main) {
  new LeaguePage(main).begin();
}

class LeaguePage {
  constructor(main) {
    document.title = "Leaderboard - Arena";
    this.query = new URLSearchParams(location.search);
    this.state = h("p", { class: "state", role: "status" }, "Looking for leagues...");
    this.choice = h("select", { id: "league", onchange: () => this.choose(this.choice.value) });
    this.table = h("div", { class: "scroll" });
    this.plot = h("div");
    this.cross = h("div", { class: "scroll" });
    this.fixture = h("div", { id: "fixture", tabindex: -1 });
    this.met = h("div", {}, h("h2", {}, "Cross table"), h("p", { class: "hint" }, "What the row scored against the column, from 0 to 1. Choose a cell for its replays."), this.cross, this.fixture);
    this.body = h("div", { hidden: true }, h("h2", {}, "Ratings"), this.table, this.plot, this.met);
    main.append(h("h1", {}, "Leaderboard"), h("div", { class: "controls" }, h("label", { for: "league" }, "League or ladder"), this.choice), this.state, this.body);
    this.order = { name: "rank", isDown: false };
    this.chosen = null;
  }

  begin() {
    new ResizeObserver(() => this.report && this.drawPlot()).observe(this.plot);
    this.refresh();
    setInterval(() => document.hidden || this.refresh(), EVERY_MS);
  }

  choose(option) {
    const [kind, name] = JSON.parse(option);
    for (const other of ["name", "ladder"]) this.query.delete(other);
    this.query.set(kind, name);
    history.replaceState(null, "", `${location.pathname}?${this.query}`);
    this.chosen = null;
    this.refresh();
  }

  async refresh() {
    const { leagues = [], ladders = [], error } = await ask(route("leagues"));
    const all = [...leagues.map((name) => ["name", name]), ...ladders.map((name) => ["ladder", name])];
    if (error || !all.length) {
      this.announce(error ?? "There is no league yet. Make one with: arena tournament init friday.toml", Boolean(error));
      return;
    }
    const [kind, name] = all.find(([one, other]) => this.query.get(one) === other) ?? all[0];
    const option = ([one, other]) => h("option", { value: JSON.stringify([one, other]) }, other);
    const group = (label, kind) => { const those = all.filter(([one]) => one === kind); return those.length ? h("optgroup", { label }, those.map(option)) : null; };
    fill(this.choice, group("Leagues", "name"), group("Ladders", "ladder"));
    this.choice.value = JSON.stringify([kind, name]);
    const report = await ask(route(kind === "ladder" ? "ladder" : "league", { name }));
    if (report.error) {
      this.announce(report.error, true);
      return;
    }
    this.report = report;
    this.isLadder = kind === "ladder";
    this.body.hidden = false;
    this.met.hidden = this.isLadder;
    if (this.isLadder) this.drawLadder();
    else this.draw();
  }

  drawLadder() {
    this.announce(`The ladder of the pit \u201c${this.report.ladder}\u201d; this page follows.`);
    fill(this.table, this.leaderboard());
    fill(this.plot, null);
  }

  draw() {
    const { report } = this;
    const { played, planned, complete } = report.matches;
    const verdict = report.sprt ? ` ${report.sprt.says}.` : "";
    this.announce(`${report.league.name}: ${played} of ${verdict ? "at most " : ""}${planned} matches are played${complete ? "" : "; this page follows"}.${verdict} Rules ${report.league.ruleset}.`);
    fill(this.table, this.leaderboard());
    this.drawPlot();
    fill(this.cross, this.crossTable());
    this.showFixture();
  }

  /** The report's leaderboard, sorted by the column that was chosen; what is not known stays below. */
  leaderboard() {
    const { columns, rows } = this.report.leaderboard;
    const { isDown } = this.order;
    const column = Math.max(0, columns.findIndex((one) => one.name === this.order.name));
    const value = (row) => row[column].key ?? `${row[column].text}`;
    const known = rows.filter((row) => value(row) !== "");
    const isNumeric = known.every((row) => !Number.isNaN(Number(value(row))));
    const compare = (one, other) => (isNumeric ? value(one) - value(other) : value(one).localeCompare(value(other)));
    const sorted = [...known.toSorted((one, other) => (isDown ? -1 : 1) * compare(one, other)), ...rows.filter((row) => value(row) === "")];
    const heads = columns.map(({ name, meaning, is_low_first }, index) => h("th", { scope: "col", title: meaning || null, "aria-sort": index === column ? (isDown ? "descending" : "ascending") : "none" },
      h("button", { type: "button", onclick: () => this.sort(name, is_low_first) }, `${name}${index === column ? (isDown ? " \u25be" : " \u25b4") : ""}`)));
    return h("table", { "aria-label": "Ratings" }, h("thead", {}, h("tr", {}, heads)), h("tbody", {}, sorted.map((row) => h("tr", {},
      row.map(({ text }, index) => (columns[index].name === "entry" ? h("th", { scope: "row" }, text) : h("td", { class: "number" }, `${text}`)))))));
  }

  sort(name, isLowFirst) {
    this.order = { name, isDown: this.order.name === name ? !this.order.isDown : !isLowFirst };
    const isFocused = this.table.contains(document.activeElement);
    this.table.replaceChildren(this.leaderboard());
    if (isFocused) [...this.table.querySelectorAll("thead button")].find((button) => button.textContent.startsWith(name)).focus();
  }

  drawPlot() {
    const width = Math.min(this.plot.clientWidth, WIDEST_PLOT);
    if (width && !this.isLadder) fill(this.plot, this.ratingPlot(width));
  }

  /** Each rating with its interval, as wide as there is room: letters stay as large as they are. */
  ratingPlot(width) {
    const rows = this.report.standings;
    const [low, high] = [Math.min(...rows.map((row) => row.elo_low)), Math.max(...rows.map((row) => row.elo_high))];
    const [left, line] = [Math.min(170, 0.36 * width), 26];
    const [nLetters, bottom] = [Math.floor((left - 14) / 8), line * rows.length + 8];
    const x = (elo) => left + ((elo - low) / (high - low || 1)) * (width - left - 20);
    const draw = (tag, properties, text = "") => {
      const element = document.createElementNS(SVG, tag);
      for (const [name, value] of Object.entries(properties)) element.setAttribute(name, value);
      element.textContent = text;
      return element;
    };
    const picture = draw("svg", { width, height: bottom + 18, role: "img", class: "plot", "aria-label": "Ratings with their 95% intervals; the table above has the numbers" });
    for (const elo of roundNumbers(low, high, width / 100)) {
      picture.append(draw("line", { x1: x(elo), x2: x(elo), y1: 0, y2: bottom, class: elo ? "rule" : "zero" }),
        draw("text", { x: x(elo), y: bottom + 14, "text-anchor": "middle", class: "axis" }, signed(elo)));
    }
    rows.forEach((row, index) => {
      const y = line * (index + 0.5) + 4;
      const name = row.entry.length > nLetters ? `${row.entry.slice(0, nLetters - 1)}\u2026` : row.entry;
      picture.append(draw("text", { x: left - 14, y: y + 5, "text-anchor": "end" }, name),
        draw("line", { x1: x(row.elo_low), x2: x(row.elo_high), y1: y, y2: y }), draw("circle", { cx: x(row.elo), cy: y, r: 5 }));
    });
    return picture;
  }

  crossTable() {
    const { standings, cross } = this.report;
    const names = standings.map((row) => row.entry);
    return h("table", { class: "cross", "aria-label": "Cross table" },
      h("thead", {}, h("tr", {}, h("td"), names.map((name) => h("th", { scope: "col", title: name }, name)))),
      h("tbody", {}, names.map((name) => h("tr", {}, h("th", { scope: "row" }, name), names.map((other) => {
        const record = [name, other].reduce((found, key) => (found && Object.hasOwn(found, key) ? found[key] : null), cross); // an entry may be called "constructor"
        if (!record || record.score === null) return h("td", { class: "number" }, name === other ? "\u00b7" : "");
        const label = `${name} against ${other}: ${record.wins} won, ${record.draws} drawn, ${record.losses} lost`;
        return h("td", { class: "number" }, h("button", { type: "button", "aria-label": label, title: label, onclick: () => this.chooseFixture(name, other) }, record.score.toFixed(2)));
      })))));
  }

  async chooseFixture(name, other) {
    this.chosen = [name, other];
    await this.showFixture();
    this.fixture.focus();
    this.fixture.scrollIntoView({ block: "nearest" });
  }

  async showFixture() {
    if (!this.chosen) {
      fill(this.fixture, null);
      return;
    }
    const [a, b] = this.chosen;
    const league = this.report.league.name;
    const data = await ask(route("head_to_head", { league, a, b }));
    if (this.chosen?.[0] !== a || this.chosen[1] !== b) return;
    fill(this.fixture, h("h2", {}, h("a", { href: address(league, a, b) }, `${a} against ${b}`)),
      ...(data.error ? [h("p", {}, data.error)] : [h("p", {}, formatScore(data)), ...describe(data)]));
  }

  announce(sentence, isBad = false) {
    setText(this.state, sentence);
    this.state.classList.toggle("bad", isBad);
  }
}
