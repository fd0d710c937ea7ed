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

// A cell of the cross table unfolds the list of its fixture's matches. Of a large league the page holds only a letter for each
// match, in one of the two cells of its fixture; cells and lists are made of these.
const lists = document.getElementById("matches");
const make = (kind, facts) => Object.assign(document.createElement(kind), facts);
const fixtures = [];
const count = (letters, of) => [...letters].filter(letter => letter === of).length;
const say = (one, other, wins, draws, losses) => `${one} v ${other}: ` +
  [[wins, "won"], [draws, "drawn"], [losses, "lost"]].filter(([n]) => n).map(([n, how]) => `${n} ${how}`).join(", ");
for (const cell of document.querySelectorAll(".cross [data-letters]")) {
  const row = cell.parentNode, table = cell.closest("table"), heads = table.tHead.rows[0].cells;
  const mirror = table.tBodies[0].rows[cell.cellIndex - 1].cells[row.sectionRowIndex + 1];
  const names = [row.cells[0].title, heads[cell.cellIndex].title], letters = cell.dataset.letters;
  const [wins, draws, losses] = [..."wdl"].map(letter => count(letters, letter));
  const says = [say(...names, wins, draws, losses), say(...[...names].reverse(), losses, draws, wins)];
  [cell, mirror].forEach((one, index) => {
    const button = make("button", {textContent: one.textContent, title: says[index]});
    button.dataset.of = fixtures.length;
    one.replaceChildren(button);
  });
  fixtures.push({names, letters, says: says[0]});
}
const write = number => {
  const {names, letters, says} = fixtures[number];
  const list = make("ul"), details = make("details"), summary = make("summary", {textContent: says, id: `fixture-${number}`});
  [...letters].forEach((letter, index) => {
    if (letter === "-") return;
    const pair = String(index >> 1).padStart(4, "0"), [blue, red] = index % 2 ? [names[1], names[0]] : names;
    const journal = [lists.dataset.league, ...names, pair, `${blue}-blue`, "0.journal"].join("+");
    const place = "bundled" in lists.dataset ? {title: journal} : {href: lists.dataset.folder + encodeURIComponent(journal)};
    const item = make("li");
    item.append(
      make("a", {textContent: `blue ${blue}, red ${red}`, ...place}),
      letter === "d" ? ": draw" : `: ${letter === "w" ? names[0] : names[1]} wins`,
    );
    list.append(item);
  });
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

// A match whose replay stands in the page opens in a window over it; its player is a page in a frame.
const room = document.getElementById("replay");
if (room) {
  const player = JSON.parse(document.getElementById("player").textContent);
  const [journal, close] = room.querySelectorAll("a, button");
  for (const link of document.querySelectorAll("[data-replay]")) link.addEventListener("click", event => {
    event.preventDefault();
    journal.href = link.href;
    room.querySelector("iframe")?.remove();
    room.append(make("iframe", {title: `Replay: ${link.textContent}`, srcdoc: player.replace("{match}", link.dataset.replay)}));
    room.showModal();
  });
  close.addEventListener("click", () => room.close());
  room.addEventListener("close", () => room.querySelector("iframe")?.remove());
}
