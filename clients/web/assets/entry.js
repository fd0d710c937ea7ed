// An entry of a season: its versions as a curve, its last matches, and what its owner alone may see.
import { ask, fill, h, ownerToken, route, setText, signed, start } from "./dom.js";
import { draw, roundNumbers } from "./plot.js";
import { number, resultTable, table } from "./results.js";
import { entryAddress, seasonAddress, time } from "./seasons.js";

const EVERY_MS = 5000;
const WIDEST_PLOT = 760;
const HEIGHT = 260;
const LETTERS = 44;

export function show(main, season, entry) {
  document.title = `${entry} in ${season} - Arena`;
  const state = h("p", { class: "state", role: "status" }, "Looking for the entry...");
  const plot = h("div");
  const versions = h("div");
  const history = h("div");
  const body = h("div", { hidden: true }, h("h2", {}, "Versions"), plot, versions, history);
  const owners = new OwnersView(season, entry, main);
  main.append(h("h1", {}, entry), h("p", {}, "An entry of the season ", h("a", { href: seasonAddress(season) }, season), "."), state, owners.element, body);
  let data = null;

  async function refresh() {
    const [answer, own] = await Promise.all([ask(route("season_entry", { season, entry })), owners.refresh()]);
    const isWaiting = answer.error && own;
    setText(state, isWaiting ? `No version of ${entry} plays yet.` : answer.error ?? describe(answer));
    state.classList.toggle("bad", Boolean(answer.error) && !isWaiting);
    body.hidden = Boolean(answer.error);
    if (answer.error) return;
    data = answer;
    drawCurve();
    fill(versions, versionTable(data));
    fill(history, ...describeHistory(season, data.is_frozen && own ? { ...data, ...own } : data));
  }

  function drawCurve() {
    const rated = data?.versions.filter(({ rating }) => rating) ?? [];
    const width = Math.min(plot.clientWidth, WIDEST_PLOT);
    if (width) fill(plot, rated.length > 1 ? curve(rated, width) : null);
  }

  new ResizeObserver(drawCurve).observe(plot);
  refresh();
  setInterval(() => document.hidden || refresh(), EVERY_MS);
}

function describe({ entry, plays, row }) {
  if (plays === null) return `${entry} was withdrawn, and plays no more.`;
  if (!row) return `Version ${plays} plays; the table does not have it yet.`;
  const rank = row.rank_low === row.rank_high ? row.rank_low : `${row.rank_low} to ${row.rank_high}`;
  return `Version ${plays} plays. In the table, version ${row.version} is at rank ${rank}, with Elo ${formatElo(row.elo)} (${formatInterval(row)}) after ${row.matches} matches.`;
}

const formatElo = (elo) => signed(Math.round(elo));
const formatInterval = ({ elo_low, elo_high }) => `${formatElo(elo_low)} to ${formatElo(elo_high)}`;

function versionTable({ versions, plays }) {
  return table("Versions", ["Version", "Elo", "95% interval", "Matches", "Since"], versions.toReversed().map(({ number: n, entered_at, rating }) => [
    h("th", { scope: "row" }, `${n}`, ...(n === plays ? [" ", h("span", { class: "tag" }, "plays")] : [])),
    ...(rating ? [formatElo(rating.elo), formatInterval(rating), rating.matches] : ["-", "-", "-"]).map(number), h("td", {}, time(entered_at))]));
}

/** The rating of each version with its interval, as wide as there is room. */
function curve(versions, width) {
  const [low, high] = [Math.min(...versions.map(({ rating }) => rating.elo_low)), Math.max(...versions.map(({ rating }) => rating.elo_high))];
  const [left, bottom] = [LETTERS, HEIGHT - 24];
  const x = (index) => left + ((index + 0.5) / versions.length) * (width - left);
  const y = (elo) => 8 + ((high - elo) / (high - low || 1)) * (bottom - 16);
  const picture = draw("svg", { width, height: HEIGHT, role: "img", class: "plot", "aria-label": "Rating of each version with its 95% interval; the table below has the numbers" });
  for (const elo of roundNumbers(low, high, HEIGHT / 50)) {
    picture.append(draw("line", { x1: left, x2: width, y1: y(elo), y2: y(elo), class: elo ? "rule" : "zero" }),
      draw("text", { x: left - 6, y: y(elo) + 4, "text-anchor": "end", class: "axis" }, signed(elo)));
  }
  picture.append(draw("polyline", { points: versions.map(({ rating }, index) => `${x(index)},${y(rating.elo)}`).join(" ") }));
  const every = Math.ceil((versions.length * LETTERS) / (width - left));
  versions.forEach(({ number: n, rating }, index) => {
    picture.append(draw("line", { x1: x(index), x2: x(index), y1: y(rating.elo_low), y2: y(rating.elo_high) }), draw("circle", { cx: x(index), cy: y(rating.elo), r: 4 }));
    if (index % every === 0) picture.append(draw("text", { x: x(index), y: HEIGHT - 6, "text-anchor": "middle", class: "axis" }, `${n}`));
  });
  return picture;
}

function describeHistory(season, { is_frozen: isFrozen, matches, best, worst }) {
  if (!matches) return [h("p", {}, isFrozen ? "While the table is frozen, matches and opponents are not shown." : "")];
  const opponents = (name, those) => (those.length ? table(name, ["Opponent", "Score", "95% interval", "Won", "Drawn", "Lost"], those.map((one) => [
    h("th", { scope: "row" }, h("a", { href: entryAddress(season, one.opponent.split(".")[0]) }, one.opponent)),
    ...[one.score.toFixed(2), `${one.low.toFixed(2)} to ${one.high.toFixed(2)}`, one.wins, one.draws, one.losses].map(number)])) : h("p", {}, "None."));
  const replay = ({ identity, is_visible: isVisible }) => (isVisible && !isFrozen ? `/match/replay?${new URLSearchParams({ league: season, identity })}` : null);
  return [
    h("div", { class: "columns" },
      h("div", {}, h("h2", {}, "Best against"), opponents("Best opponents", best)), h("div", {}, h("h2", {}, "Worst against"), opponents("Worst opponents", worst))),
    h("h2", {}, "Last matches"),
    matches.length ? resultTable("Last matches", matches.map((one) => ({ ...one, href: replay(one) }))) : h("p", {}, "None yet."),
    h("p", { class: "hint" }, "A match can be replayed once the other one of its pair, on the same map, is over."),
  ];
}

/** What the owner sees who came by the link of `arena submit --status`. */
class OwnersView {
  constructor(season, entry, main) {
    [this.season, this.entry, this.main] = [season, entry, main];
    this.state = h("p", { role: "status" });
    this.submissions = h("div");
    this.found = h("pre", { tabindex: 0, role: "region", "aria-label": "What the last check found" });
    this.log = h("pre", { tabindex: 0, role: "region", "aria-label": "Log" });
    this.check = h("div", { hidden: true }, h("h3", {}, "What the last check found"), this.found);
    this.logs = h("details", { hidden: true }, h("summary", {}, "The end of its log"), this.log);
    this.body = h("div", { hidden: true }, this.submissions, this.check, this.logs,
      h("p", {}, h("button", { type: "button", onclick: () => this.leave() }, "Forget this in this tab")));
    this.element = h("section", { "aria-label": "For its owner", hidden: true }, h("h2", {}, "For its owner"), this.state, this.body);
  }

  leave() {
    ownerToken.set("");
    this.element.hidden = true;
    this.main.focus();
  }

  /** Ask anew; returns what the owner sees, or null. */
  async refresh() {
    const token = ownerToken.get();
    if (!token) return null;
    const own = await ask(route("season_own", { season: this.season, entry: this.entry }), { headers: { [start.tokenHeader]: token } });
    if (!ownerToken.get()) return null;
    this.element.hidden = false;
    this.body.hidden = Boolean(own.error);
    setText(this.state, own.error ? `Not shown: ${own.error}.` : describeQueue(own));
    if (own.error) return null;
    fill(this.submissions, own.submissions.length ? listSubmissions(own.submissions) : null);
    const checked = own.submissions.find(({ lines }) => lines.length);
    this.check.hidden = !checked;
    setText(this.found, checked?.lines.join("\n") ?? "");
    this.logs.hidden = !own.log;
    setText(this.log, own.log);
    return own;
  }
}

function describeQueue({ queue, submissions }) {
  if (queue === null) return submissions.length ? "Nothing waits for its check." : "Nothing was submitted by this key.";
  return queue === 1 ? "The last submission is checked next, or just now." : `The last submission waits for its check, as number ${queue}.`;
}

function listSubmissions(submissions) {
  return h("ul", { "aria-label": "Submissions" }, submissions.map((one) => h("li", {}, time(one.received_at), " ", h("span", { class: "tag" }, one.state),
    `${one.number === null ? "" : `version ${one.number}, `}${one.n_bytes} bytes${one.says ? `: ${one.says}` : ""}`)));
}
