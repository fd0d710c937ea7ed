// A season: the table of the versions that play, and how long their authors can still submit.
import { ask, fill, h, route, setText } from "./dom.js";
import { Leaderboard } from "./leaderboard.js";
import { entryAddress, formatTimeLeft, time } from "./seasons.js";

const EVERY_MS = 5000;
const PHASES = {
  open: "The season is open: its authors submit, and the table follows.",
  frozen: "The table is frozen: what is played now shows when the season is over. Its authors may still submit.",
  final: "The final is being played, and nothing more can be submitted.",
  over: "The season is over.",
};

export function show(main, season) {
  document.title = `${season} - Arena`;
  const state = h("p", { class: "state", role: "status" }, "Looking for the season...");
  const left = h("span", { role: "timer", class: "number" });
  const facts = h("dl", { class: "facts" });
  const leaderboard = new Leaderboard((entry) => entryAddress(season, entry));
  const body = h("div", { hidden: true }, facts, h("h2", {}, "Table"), leaderboard.element,
    h("p", { class: "hint" }, "Elo and its 95% interval, of each entry's current version. An entry's page shows its versions and its matches."));
  main.append(h("h1", {}, season), state, body);
  let deadline = null;

  async function refresh() {
    const data = await ask(route("season", { name: season }));
    announce(data);
    body.hidden = !data.leaderboard;
    if (!data.leaderboard) return;
    deadline = data.deadline ? Date.parse(data.deadline) / 1000 : null;
    fill(facts, ...describe(data, deadline));
    if (deadline && data.phase !== "over") facts.querySelector(".deadline")?.append(" ", left);
    count();
    leaderboard.show(data.leaderboard);
  }

  function announce({ error, leaderboard: table, phase }) {
    setText(state, error ?? (table ? PHASES[phase] ?? phase : "The season has not begun."));
    state.classList.toggle("bad", Boolean(error));
  }

  function count() {
    const text = deadline ? formatTimeLeft(deadline) : "";
    setText(left, text && `(${text} left)`);
  }

  refresh();
  setInterval(() => document.hidden || refresh(), EVERY_MS);
  setInterval(count, 1000);
}

function describe({ matches, playing, waiting, made_at, final, secret }, deadline) {
  const rows = [
    ["Deadline", deadline ? [time(deadline)] : ["none"], "deadline"],
    ["Matches", [`${matches} played, ${playing} running`]],
    ["Submissions", [`${waiting} ${waiting === 1 ? "waits" : "wait"} for a check`]],
    ["As of", [time(made_at)]],
    ...(final ? [["Final", [h("a", { href: `/league?${new URLSearchParams({ name: final })}` }, final)]]] : []),
    ...(secret ? [["Secret of all maps", [secret]]] : []),
  ];
  return rows.flatMap(([name, value, kind]) => [h("dt", {}, name), h("dd", { class: kind }, ...value)]);
}
