// The rules of the pit in words, with the numbers of its ruleset.
import { ask, h, route, setText } from "./dom.js";

export async function show(main) {
  document.title = "Rules - Arena";
  const state = h("p", { class: "state", role: "status" }, "Looking for the pit...");
  main.append(h("h1", {}, "Rules"), state);
  const { lobby, error, trouble } = await ask(route("lobby"));
  state.classList.toggle("bad", !lobby);
  setText(state, error ?? (lobby ? `The pit \u201c${lobby.pit}\u201d plays the ruleset ${lobby.rules}.` : `The pit is away: ${trouble}.`));
  if (lobby) main.append(...describe(lobby.ruleset));
}

const plural = (n, what) => `${n} ${what}${n === 1 ? "" : "s"}`;

function describe(rules) {
  const kinds = Object.entries(rules.units);
  const name = (flies) => kinds.filter(([, kind]) => kind.flies === flies).map(([one]) => one.toUpperCase());
  const [walkers, flyers] = [name(false), name(true)];
  const facts = [["blue has", "blue"], ["red has", "red"], ["cells a tick", "step"], ["sight", "sight"], ["attack", "attack"], ["strength", "strength"]];
  return [
    h("p", {}, `Two teams, blue and red, play Capture the Flag on a board of ${rules.side} x ${rules.side} cells. Each half belongs to one team, and holds its flag. `,
      rules.fog ? "Nobody sees more than their own units see." : "Everybody sees the whole board."),
    h("h2", {}, "How a match is won"),
    h("dl", { class: "facts" },
      ...[["Capture", `a ${walkers.join(" or ")} stands on the enemy's flag`],
        ["Elimination", `the enemy's last ${walkers.join(" or ")} falls`],
        ["Points", `after ${plural(rules.tick_limit, "tick")}: 10 for each enemy that fell, less 10 for each of one's own; equal points are a draw`]]
        .flatMap(([word, text]) => [h("dt", {}, word), h("dd", {}, text)])),
    h("h2", {}, "Units"),
    h("table", { "aria-label": "Units" },
      h("thead", {}, h("tr", {}, h("td"), kinds.map(([one]) => h("th", { scope: "col" }, one.toUpperCase())))),
      h("tbody", {}, facts.map(([word, key]) => h("tr", {}, h("th", { scope: "row" }, word), kinds.map(([, kind]) => h("td", { class: "number" }, `${kind[key] || "none"}`)))))),
    h("h2", {}, "One tick"),
    h("p", {}, "Every unit stays or goes north, east, south or west, all at once. Who walks stops before obstacles, and no two that walk share a cell: who would swap cells stay, and of several that want one cell chance lets one go."),
    flyers.length ? h("p", {}, `A ${flyers.join(" or ")} flies: it passes over obstacles and units, cannot be hit, and captures nothing.`) : null,
    h("p", {}, `Then those fight that walk and are in reach of an enemy that walks, at a distance of ${rules.attack_at_range ? "at most" : "less than"} its attack. `,
      rules.random_combat
        ? `Who fights survives with the chance F / (F + E). F is the strength of ${rules.self_counts ? "the unit itself and of " : ""}every friend that has its cell in reach, and 1 more on the own half; E that of every enemy that has its cell in reach, and 1 more on the enemy's half.`
        : "Who fights on the enemy's half falls, and nobody falls at home."),
    rules.fog ? h("h2", {}, "Fog") : null,
    rules.fog ? h("p", {}, "A team sees the cells no farther than the sight of one of its living units, and nothing blocks sight. The tick, the score and how many live are known to all.") : null,
    h("p", { class: "hint" }, "What decides is docs/reference/rules.md of the arena, where each rule stands with drawn examples; arena rules shows every ruleset."),
  ].filter(Boolean);
}
