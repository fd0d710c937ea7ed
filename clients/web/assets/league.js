// The leaderboards of the store, live: of leagues, ratings with their intervals, the cross table, and every replay; of ladders, the ratings.
import { ask, fill, h, route, setText, signed } from "./dom.js";
import { address, describe, formatScore } from "./head_to_head.js";
import { Leaderboard } from "./leaderboard.js";
import { draw, roundNumbers } from "./plot.js";
import { listSeasons } from "./seasons.js";

const EVERY_MS = 5000;
const WIDEST_PLOT = 760;

export function show(main) {
  new LeaguePage(main).begin();
}

class LeaguePage {
  constructor(main) {
    document.title = "Leaderboard - Arena";
    this.query = new URLSearchParams(location.search);
    this.state = h("p", { class: "state", role: "status" }, "Looking for leagues...");
    this.seasons = h("div");
    this.choice = h("select", { id: "league", onchange: () => this.choose(this.choice.value) });
    this.leaderboard = new Leaderboard();
    this.plot = h("div");
    this.cross = h("div", { class: "scroll" });
    this.fixture = h("div", { id: "fixture", tabindex: -1 });
    this.met = h("div", {}, h("h2", {}, "Cross table"), h("p", { class: "hint" }, "What the row scored against the column, from 0 to 1. Choose a cell for its replays."), this.cross, this.fixture);
    this.body = h("div", { hidden: true }, h("h2", {}, "Ratings"), this.leaderboard.element, this.plot, this.met);
    main.append(h("h1", {}, "Leaderboard"), h("div", { class: "controls" }, h("label", { for: "league" }, "League or ladder"), this.choice), this.seasons, this.state, this.body);
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
    const { seasons = [] } = await ask(route("seasons"));
    const all = [...leagues.map((name) => ["name", name]), ...ladders.map((name) => ["ladder", name])];
    fill(this.seasons, listSeasons(seasons));
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
    this.leaderboard.show(this.report.leaderboard);
    fill(this.plot, null);
  }

  draw() {
    const { report } = this;
    const { played, planned, complete } = report.matches;
    const verdict = report.sprt ? ` ${report.sprt.says}.` : "";
    this.announce(`${report.league.name}: ${played} of ${verdict ? "at most " : ""}${planned} matches are played${complete ? "" : "; this page follows"}.${verdict} Rules ${report.league.ruleset}.`);
    this.leaderboard.show(this.report.leaderboard);
    this.drawPlot();
    fill(this.cross, this.crossTable());
    this.showFixture();
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
