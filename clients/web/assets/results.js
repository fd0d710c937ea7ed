// Tables, and among them that of matches which are over: each fact once.
import { h, words } from "./dom.js";

/** A table that scrolls where it is too wide; `rows` are lists of cells. */
export function table(name, heads, rows) {
  return h("div", { class: "scroll", role: "region", "aria-label": name, tabindex: 0 }, h("table", { "aria-label": name },
    h("thead", {}, h("tr", {}, heads.map((head) => (head ? h("th", { scope: "col" }, head) : h("td"))))),
    h("tbody", {}, rows.map((cells) => h("tr", {}, cells)))));
}

export const number = (value) => h("td", { class: "number" }, `${value}`);

/** Say who won, and how; the sides stand beside it. */
function formatOutcome({ winner, ending, score }) {
  if (winner === null) return ending === "void" ? "void" : "draw";
  return `${winner} ${ending === "tick_limit" ? `by ${Math.abs(score)} points` : `by ${words(ending)}`}`;
}

/** Matches as {blue, red, winner, ending, score, ticks, reason, href}, and perhaps `tags` ({name, meaning}); some have no replay. */
export function resultTable(name, matches) {
  return table(name, ["Blue", "Red", "Winner", "Ticks"], matches.map((one) => {
    const outcome = formatOutcome(one);
    return [
      ...["blue", "red"].map((side) => h("td", { class: side, title: one[side] }, one.winner === side ? h("b", {}, one[side]) : one[side])),
      h("td", {}, one.href ? h("a", { href: one.href, title: one.reason || "Replay", "aria-label": `Replay of ${one.blue} against ${one.red}: ${outcome}` }, outcome) : outcome,
        (one.tags ?? []).flatMap((tag) => [" ", h("span", { class: "tag", title: tag.meaning }, tag.name)])),
      number(one.ticks),
    ];
  }));
}
