// The lobby: what everyone may know of the pit, and how to join it.
import { ask, fill, h, route, setText, spectatorKey, formatEnding } from "./dom.js";

const EVERY_MS = 1000;

export function show(main) {
  document.title = "Lobby - Arena";
  const state = h("p", { class: "state", role: "status" }, "Looking for the pit...");
  const facts = h("dl", { class: "facts" });
  const running = h("div");
  const waiting = h("p");
  const results = h("div");
  const standings = h("div");
  const command = h("code", {}, "");
  main.append(
    h("h1", {}, "Lobby"),
    state,
    h("div", { class: "columns" },
      h("div", {}, h("h2", {}, "Running matches"), running, h("h2", {}, "Open seats"), waiting),
      h("div", {}, h("h2", {}, "Join with a bot"), h("div", { class: "command" }, command, copier(command)),
        h("p", { class: "hint" }, "A bot is a fighter's name, or a file such as mybot.py. Or ", h("a", { href: "/play" }, "play yourself"), ".")),
      h("div", {}, h("h2", {}, "Latest results"), results, standings),
      h("div", {}, h("h2", {}, "Rules"), facts)),
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
    setText(waiting, lobby ? formatSeats(lobby) : "Not known.");
    fill(results, answer.results.length ? resultList(answer.results) : h("p", {}, "No match has ended since this page's server was started."));
    fill(standings, lobby?.standings?.length ? ladder(lobby.standings) : null);
    fill(facts, lobby ? formatRules(lobby) : null);
  }
  refresh();
  setInterval(() => document.hidden || refresh(), EVERY_MS);
}

function formatSeats(lobby) {
  const invite = lobby.needs_invite ? " This pit wants an invite code." : "";
  if (!lobby.waiting.length) return `Blue and red: nobody waits yet.${invite}`;
  return `${lobby.waiting.join(", ")} ${lobby.waiting.length > 1 ? "wait" : "waits"} for an opponent.${invite}`;
}

function runningTable(matches) {
  return h("table", { "aria-label": "Running matches" },
    h("thead", {}, h("tr", {}, ...["Blue", "Red", "Tick", ""].map((name) => h("th", { scope: "col" }, name)))),
    h("tbody", {}, matches.map((one) => h("tr", {},
      h("td", { class: "blue" }, one.blue), h("td", { class: "red" }, one.red), h("td", { class: "number" }, `${one.tick}`),
      h("td", {}, h("a", { href: `/match/${encodeURIComponent(one.match)}`, "aria-label": `Watch ${one.blue} against ${one.red}` }, "Watch"))))));
}

function resultList(results) {
  return h("ol", { class: "results" }, results.map((one) => h("li", {},
    h("a", { href: `/match/${encodeURIComponent(one.match)}` },
      one.names ? [h("b", { class: "blue" }, one.names[0]), " against ", h("b", { class: "red" }, one.names[1])] : "Replay"),
    `: ${formatEnding(one)}`)));
}

function ladder(rows) {
  return h("section", {}, h("h2", {}, "Ladder"), h("div", { class: "scroll", role: "region", "aria-label": "Ladder", tabindex: 0 }, h("table", { "aria-label": "Ladder" },
    h("thead", {}, h("tr", {}, ...["Entry", "Rating", "Wins", "Draws", "Losses"].map((name) => h("th", { scope: "col" }, name)))),
    h("tbody", {}, rows.map((row) => h("tr", {}, h("th", { scope: "row" }, row.name),
      ...[Number(row.rating).toFixed(1).replace("-", "\u2212"), row.wins, row.draws, row.losses].map((value) => h("td", { class: "number" }, `${value}`))))))));
}

function formatRules(lobby) {
  const { ruleset } = lobby;
  const units = Object.entries(ruleset.units ?? {});
  const rows = [
    ["Ruleset", lobby.rules],
    ["Board", `${ruleset.side} x ${ruleset.side}`],
    ["Ticks", `${ruleset.tick_limit}`],
    ["Fog", ruleset.fog ? "yes" : "no"],
    ["Combat", ruleset.random_combat ? "random" : "certain"],
    ...units.map(([name, unit]) => [name.toUpperCase(),
      `${unit.blue} blue, ${unit.red} red: step ${unit.step}, sight ${unit.sight}${unit.flies ? ", flies" : `, attack ${unit.attack}`}`]),
  ];
  return rows.flatMap(([name, value]) => [h("dt", {}, name), h("dd", {}, value)]);
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
