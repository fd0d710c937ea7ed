// Two entries of a league against each other: the score, by side, by ending, and every match with its replay.
import { ask, fill, h, route, setText, words } from "./dom.js";
import { number, resultTable, table } from "./results.js";

const EVERY_MS = 5000;

export function show(main) {
  const query = new URLSearchParams(location.search);
  const [league, a, b] = ["league", "a", "b"].map((name) => query.get(name) ?? "");
  document.title = `${a} against ${b} - Arena`;
  const state = h("p", { class: "state", role: "status" }, "Looking for the league...");
  const body = h("div");
  main.append(h("h1", {}, `${a} against ${b}`), state, body,
    h("p", {}, h("a", { href: `/league?${new URLSearchParams({ name: league })}` }, "To the leaderboard")));

  async function refresh() {
    const data = await ask(route("head_to_head", { league, a, b }));
    setText(state, data.error ?? `League ${data.league}. ${formatScore(data)}`);
    state.classList.toggle("bad", Boolean(data.error));
    if (!data.error) fill(body, ...describe(data));
  }
  refresh();
  setInterval(() => document.hidden || refresh(), EVERY_MS);
}

/** Where the page of two entries is. */
export function address(league, a, b) {
  return `/league/head-to-head?${new URLSearchParams({ league, a, b })}`;
}

export function formatScore({ entries: [name], record: { score, low, high, pairs } }) {
  if (score === null) return "They have not met yet.";
  return `${name} scored ${score.toFixed(2)} a match; over ${pairs} ${pairs === 1 ? "pair" : "pairs"} the 95% interval is ${low.toFixed(2)} to ${high.toFixed(2)}.`;
}

/** What stands below the score: a table of what the first made of it, and the matches. */
export function describe({ league, entries: [name], record, by_side, by_ending, matches }) {
  if (!matches.length) return [];
  const rows = [["all", record], ...Object.entries(by_side).map(([side, kept]) => [`as ${side}`, kept]),
    ...Object.entries(by_ending).map(([ending, kept]) => [`by ${words(ending)}`, kept])];
  return [
    table(`Record of ${name}`, ["Matches", "Won", "Drawn", "Lost"], rows.map(([what, kept]) => [h("th", { scope: "row" }, what), number(kept.wins), number(kept.draws), number(kept.losses)])),
    resultTable("Matches", matches.map((one) => ({ ...one, href: `/match/replay?${new URLSearchParams({ league, identity: one.identity })}` }))),
    legend(matches),
  ];
}

/** Say what the tags mean that stand there: a title is for those alone who can point at it. */
function legend(matches) {
  const tags = new Map(matches.flatMap((one) => one.tags.map(({ name, meaning }) => [name, meaning])));
  return tags.size ? h("dl", { class: "facts hint" }, ...[...tags].flatMap(([name, meaning]) => [h("dt", {}, name), h("dd", {}, meaning)])) : null;
}
