"use strict";

// A click on a column's head, or Enter or Space on it, sorts; what is not known stays below.
for (const button of document.querySelectorAll(".sortable thead button")) button.addEventListener("click", () => {
  const head = button.closest("th"), body = head.closest("table").tBodies[0];
  const value = row => row.cells[head.cellIndex].dataset.value ?? row.cells[head.cellIndex].textContent.trim();
  const known = [...body.rows].filter(row => value(row) !== ""), unknown = [...body.rows].filter(row => value(row) === "");
  const isNumeric = known.every(row => !Number.isNaN(Number(value(row))));
  const sorted = head.getAttribute("aria-sort");
  const isUp = sorted ? sorted !== "ascending" : !isNumeric || "up" in head.dataset;
  for (const other of head.parentNode.cells) other.removeAttribute("aria-sort");
  head.setAttribute("aria-sort", isUp ? "ascending" : "descending");
  const order = (a, b) => isNumeric ? value(a) - value(b) : value(a).localeCompare(value(b));
  body.append(...known.sort((a, b) => isUp ? order(a, b) : order(b, a)), ...unknown);
});

// A cell of the cross table unfolds the list of its fixture's matches; the lists of a large league are written only then.
const lists = document.getElementById("matches");
const make = (kind, text = "") => Object.assign(document.createElement(kind), {textContent: text});
const write = number => {
  const cell = document.querySelector(`[data-of="${number}"][data-letters]`);
  const row = cell.closest("tr"), table = cell.closest("table");
  const names = [row.cells[0].title, table.tHead.rows[0].cells[cell.closest("td").cellIndex].title];
  const list = make("ul"), details = make("details"), summary = make("summary", cell.title);
  [...cell.dataset.letters].forEach((letter, index) => {
    if (letter === "-") return;
    const pair = String(index >> 1).padStart(4, "0"), [blue, red] = index % 2 ? [names[1], names[0]] : names;
    const link = make("a", `blue ${blue}, red ${red}`), item = make("li");
    const journal = [lists.dataset.league, ...names, pair, `${blue}-blue`, "0.journal"].join("+");
    link.href = lists.dataset.folder + encodeURIComponent(journal);
    item.append(link, letter === "d" ? ": draw" : `: ${letter === "w" ? names[0] : names[1]} wins`);
    list.append(item);
  });
  summary.id = `fixture-${number}`;
  details.append(summary, list);
  lists.append(details);
  return summary;
};
for (const cell of document.querySelectorAll("[data-of]")) cell.addEventListener("click", () => {
  const summary = document.getElementById(`fixture-${cell.dataset.of}`) ?? write(cell.dataset.of);
  summary.parentNode.open = true;
  summary.scrollIntoView({block: "center"});
  summary.focus({preventScroll: true});
});
