// The lobby: what everyone may know of the pit, the last match, and how to join.
import { ask, fill, h, route, setText, spectatorKey } from "./dom.js";
import { LastMatch } from "./last_match.js";
import { number, resultTable, table } from "./results.js";
import { listSeasons } from "./seasons.js";

const EVERY_MS = 1000;
const SEASONS_MS = 30_000;

export function show(main) {
  document.title = "Lobby - Arena";
  const state = h("p", { class: "state", role: "status" }, "Looking for the pit...");
  const rules = h("p");
  const publicity = h("div");
  const running = h("div");
  const waiting = h("p");
  const over = h("div");
  const seasons = h("div");
  const standings = h("div");
  const command = h("code", {}, "");
  const last = new LastMatch();
  main.append(
    h("h1", {}, "Lobby"),
    state,
    h("div", { class: "columns" },
      h("div", {},
        h("h2", {}, "Join with a bot"), h("div", { class: "command" }, command, copier(command)),
        h("p", { class: "hint" }, "A bot is a fighter's name, or a file such as mybot.py. Or ", h("a", { href: "/play" }, "play yourself"), "."),
        rules, publicity,
        h("h2", {}, "Open seats"), waiting,
        h("h2", {}, "Running matches"), running,
        h("h2", {}, "Latest results"), over, standings, seasons),
      last.section),
    keyForm(),
  );

  async function refresh() {
    const answer = await ask(route("lobby"));
    const { lobby } = answer;
    setText(state, answer.error ?? (lobby ? `The pit \u201c${lobby.pit}\u201d is open; matches so far: ${lobby.n_begun}.` : `The pit is away: ${answer.trouble}.`));
    state.classList.toggle("bad", !lobby);
    if (answer.error) return;
    setText(command, `arena join ${answer.address} --team any --policy mybot.py`);
    fill(running, lobby?.running.length ? runningTable(lobby.running) : h("p", {}, lobby ? "None." : "Not known."));
    fill(publicity, lobby?.public_delay ? formatPublicity(lobby.public_delay) : null);
    setText(waiting, lobby ? formatSeats(lobby) : "Not known.");
    fill(over, answer.results.length ? results(answer.results) : h("p", {}, "No match has ended since this page's server was started."));
    fill(standings, lobby?.standings?.length ? ladder(lobby.standings) : null);
    fill(rules, ...(lobby ? formatRules(lobby) : []));
    last.refresh(answer.results);
  }
  async function refreshSeasons() {
    const { seasons: names = [] } = await ask(route("seasons"));
    fill(seasons, names.length ? h("h2", {}, "Seasons") : null, listSeasons(names));
  }
  refresh();
  refreshSeasons();
  setInterval(() => document.hidden || refresh(), EVERY_MS);
  setInterval(() => document.hidden || refreshSeasons(), SEASONS_MS);
}

function formatPublicity(delay) {
  return h("p", { class: "note" }, `This pit shows the boards of running matches to everyone, ${delay} ticks late. Flags and obstacles do not move: whoever plays here may know of them what their own units never saw.`);
}

function formatSeats(lobby) {
  const invite = lobby.needs_invite ? " This pit wants an invite code." : "";
  if (!lobby.waiting.length) return `Blue and red: nobody waits yet.${invite}`;
  return `${lobby.waiting.join(", ")} ${lobby.waiting.length > 1 ? "wait" : "waits"} for an opponent.${invite}`;
}

function runningTable(matches) {
  return table("Running matches", ["Blue", "Red", "Tick", ""], matches.map((one) => [
    h("td", { class: "blue" }, one.blue), h("td", { class: "red" }, one.red), number(one.tick),
    h("td", {}, h("a", { href: `/match/${encodeURIComponent(one.match)}`, "aria-label": `Watch ${one.blue} against ${one.red}` }, "Watch"))]));
}

function results(matches) {
  return resultTable("Latest results", matches.map((one) => {
    const [blue, red] = one.names ?? ["?", "?"];
    return { ...one, blue, red, href: `/match/${encodeURIComponent(one.match)}` };
  }));
}

function ladder(rows) {
  return h("section", {}, h("h2", {}, "Ladder"), table("Ladder", ["Entry", "Rating", "Wins", "Draws", "Losses"], rows.map((row) => [h("th", { scope: "row" }, row.name),
    ...[Number(row.rating).toFixed(1).replace("-", "\u2212"), row.wins, row.draws, row.losses].map(number)])));
}

function formatRules({ rules, ruleset }) {
  const units = Object.entries(ruleset.units ?? {}).map(([name, { blue, red }]) => `${blue === red ? blue : `${blue} and ${red}`} ${name.toUpperCase()}s`);
  return [h("a", { href: "/rules" }, "The rules"), ` are those of ${rules}: ${ruleset.side} x ${ruleset.side} cells, ${ruleset.tick_limit} ticks, each team with ${units.join(" and ")}${ruleset.fog ? ", in the fog" : ""}.`];
}

function copier(source) {
  const button = h("button", { type: "button" }, "Copy");
  button.addEventListener("click", async () => {
    await navigator.clipboard.writeText(source.textContent);
    button.textContent = "Copied";
  });
  return button;
}

function keyForm() {
  const field = h("input", { id: "key", type: "password", autocomplete: "off", spellcheck: "false", value: spectatorKey.get() });
  const said = h("span", { role: "status" }, "");
  const form = h("form", {}, h("label", { for: "key" }, "Spectator key"), " ", field, " ", h("button", {}, "Keep in this tab"), " ", said);
  form.addEventListener("submit", (event) => {
    event.preventDefault();
    spectatorKey.set(field.value.trim());
    said.textContent = field.value.trim() ? "Kept: running matches show their boards." : "Forgotten.";
  });
  return h("details", {}, h("summary", {}, "I have the spectator key"), h("p", { class: "hint" },
    "While a match runs, only its holder sees boards. It is in keys/spectator.key of the pit's data folder."), form);
}
