// A leaderboard, sorted by the column that is chosen.
import { h } from "./dom.js";

export class Leaderboard {
  /** `addressOf` says where an entry's page is, if it has one. */
  constructor(addressOf = () => null) {
    this.addressOf = addressOf;
    this.element = h("div", { class: "scroll" });
    this.order = { name: "rank", isDown: false };
  }

  /** Show `columns` ({name, meaning, is_low_first}) and `rows` of cells ({text, key, tag}). */
  show(data) {
    const table = this.draw(data);
    this.data = data;
    if (!this.element.firstChild?.isEqualNode(table)) this.element.replaceChildren(table);
  }

  /** The table as it is sorted now; what is not known stays below. */
  draw({ columns, rows }) {
    const { isDown } = this.order;
    const column = Math.max(0, columns.findIndex((one) => one.name === this.order.name));
    const value = (row) => row[column].key ?? `${row[column].text}`;
    const known = rows.filter((row) => value(row) !== "");
    const isNumeric = known.every((row) => !Number.isNaN(Number(value(row))));
    const compare = (one, other) => (isNumeric ? value(one) - value(other) : value(one).localeCompare(value(other)));
    const sorted = [...known.toSorted((one, other) => (isDown ? -1 : 1) * compare(one, other)), ...rows.filter((row) => value(row) === "")];
    const heads = columns.map(({ name, meaning, is_low_first }, index) => h("th", { scope: "col", title: meaning || null, "aria-sort": index === column ? (isDown ? "descending" : "ascending") : "none" },
      h("button", { type: "button", onclick: () => this.sort(name, is_low_first) }, `${name}${index === column ? (isDown ? " \u25be" : " \u25b4") : ""}`)));
    return h("table", { "aria-label": "Ratings" }, h("thead", {}, h("tr", {}, heads)), h("tbody", {}, sorted.map((row) => h("tr", {},
      row.map((cell, index) => (columns[index].name === "entry" ? this.nameCell(cell) : h("td", { class: "number" }, `${cell.text}`)))))));
  }

  nameCell({ text, tag }) {
    const href = this.addressOf(text);
    return h("th", { scope: "row" }, href ? h("a", { href }, text) : text, ...(tag ? [" ", h("span", { class: "tag" }, tag)] : []));
  }

  sort(name, isLowFirst) {
    this.order = { name, isDown: this.order.name === name ? !this.order.isDown : !isLowFirst };
    const isFocused = this.element.contains(document.activeElement);
    this.show(this.data);
    if (isFocused) [...this.element.querySelectorAll("thead button")].find((button) => button.textContent.startsWith(name)).focus();
  }
}
