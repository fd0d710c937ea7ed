// The ticks of a match as a slider, and over it a mark for each fight, fall and capture.
import { h } from "./dom.js";
import { milestonesOf } from "./events.js";

const MARK_SIGNS = { fight: "", fall: "\u00d7", capture: "\u2691" };

export class Timeline {
  /** `choose` hears the tick that a person picks. */
  constructor(choose) {
    this.choose = choose;
    this.milestones = [];
    this.slider = h("input", { type: "range", class: "timeline", min: 0, max: 0, value: 0, "aria-label": "Tick", oninput: () => choose(Number(this.slider.value)) });
    this.marks = h("div", { class: "marks" }); // for the pointer; by keyboard, N and P go there
    this.element = h("div", { class: "track" }, this.marks, this.slider);
  }

  /** Take the ticks that there are; what is at a place stays there while none is added. */
  measure(data) {
    const last = data.ticks.length - 1;
    if (Number(this.slider.max) === last && this.marks.children.length) return;
    this.slider.max = last;
    this.milestones = milestonesOf(data);
    this.marks.replaceChildren(...this.milestones.map(({ at, kind, title }) => {
      const mark = h("span", { class: `mark ${kind}`, title, onclick: () => this.choose(at) }, MARK_SIGNS[kind]);
      mark.style.left = `calc(0.5rem + (100% - 1rem) * ${last ? at / last : 0})`;
      return mark;
    }));
  }

  /** The next milestone behind a tick, or the one before it; null if there is none. */
  find(at, by) {
    const found = by > 0 ? this.milestones.find((one) => one.at > at) : this.milestones.findLast((one) => one.at < at);
    return found ? found.at : null;
  }
}
