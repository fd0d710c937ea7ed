// What can be taken along from a replay: its journal, all of it as one HTML file, or some ticks as a GIF; and how to embed it.
import { h, setText } from "./dom.js";

const MOST_GIF_TICKS = 50;
const FORMS = { journal: ["Journal", ".journal"], html: ["One HTML file", ".html"] };

export class Downloads {
  /** `fetch` asks for a form with a query, and returns a Blob or {error}; `forms` are those that can be had. */
  constructor(player, fetch, forms) {
    const { ticks, names } = player.data;
    const last = ticks.length - 1;
    this.player = player;
    this.fetch = fetch;
    this.name = `${names.join("-against-")}`.replace(/[^\w-]+/g, "_");
    this.state = h("p", { class: "hint", role: "status" });
    const number = (label, value) => h("input", { type: "number", min: 0, max: last, value, "aria-label": label, size: 4 });
    this.first = number("First tick of the GIF", 0);
    this.last = number("Last tick of the GIF", Math.min(last, MOST_GIF_TICKS));
    const button = (text, onclick) => h("button", { type: "button", onclick }, text);
    this.element = h("section", { class: "downloads", "aria-label": "Downloads" }, h("h2", {}, "Take it along"),
      h("div", { class: "controls" },
        Object.entries(FORMS).filter(([form]) => forms.includes(form)).map(([form, [label, suffix]]) => button(label, () => this.save(form, {}, suffix))),
        button("GIF", () => this.saveGif()), "of ticks ", this.first, " to ", this.last),
      this.state);
  }

  saveGif() {
    const { view } = this.player;
    return this.save("gif", { first: this.first.value, last: this.last.value, team: view === "red" ? "red" : "" }, ".gif");
  }

  async save(form, query, suffix) {
    setText(this.state, "A moment...");
    const made = await this.fetch(form, query);
    setText(this.state, made.error ? `This cannot be had: ${made.error}.` : "");
    if (made.error) return;
    const link = h("a", { href: URL.createObjectURL(made), download: this.name + suffix });
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 60_000);
  }
}

/** What another page writes to show a match: its boards and controls alone. */
export function embedding(match) {
  const code = `<iframe src="${location.origin}/embed/match/${encodeURIComponent(match)}" width="560" height="720" title="A match in the arena"></iframe>`;
  const field = h("input", { class: "code", readonly: true, value: code, "aria-label": "To embed it", onfocus: () => field.select() });
  return h("p", { class: "controls embedding" }, "To embed it:", field);
}
