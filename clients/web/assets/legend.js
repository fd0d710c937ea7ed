// What the signs on a board mean, each drawn as the board draws it; and a list of keys.
import { Board, CODE } from "./board.js";
import { h } from "./dom.js";

const GROUND = "0";
const SIGNS = [
  ["blue UGV", { grid: CODE.blueUgv }], ["blue UAV", { grid: CODE.blueUav }], ["red UGV", { grid: CODE.redUgv }], ["red UAV", { grid: CODE.redUav }],
  ["its number and order", { grid: CODE.blueUgv, names: new Map([[`0 ${CODE.blueUgv}`, "2"]]), arrows: [{ cell: [0, -0.36], action: 2, team: "blue" }] }],
  ["flag", { grid: CODE.redFlag }], ["obstacle", { grid: CODE.obstacle }], ["fog", { grid: "?" }],
  ["fights", { grid: CODE.redUgv, marks: [{ cell: [0, 0], kind: "fight" }] }], ["fell", { grid: GROUND, marks: [{ cell: [0, 0], kind: "fall" }] }],
  ["flag captured", { grid: CODE.redFlag, marks: [{ cell: [0, 0], kind: "capture" }] }],
];
const BOT_SIGN = ["drawn by the bot", { grid: GROUND, drawings: [{ cell: [0, 0], colour: "yellow" }] }];

/** What a board shows to a person who plays: what is lit is of the unit that is chosen. */
export const PLAY_SIGNS = [
  ["chosen", { grid: GROUND, selected: [0, 0] }], ["in its sight", { grid: GROUND, discs: [{ cell: [0, 0], sight: 0, reach: -1 }] }],
  ["where it hits", { grid: GROUND, discs: [{ cell: [0, 0], sight: 0, reach: 0 }] }], ["where it is sent", { grid: GROUND, routes: [[[0, -0.5], [0, 0]]] }],
  ["where it can go now", { grid: GROUND, steps: [[0, 0]] }], ["flag", { grid: CODE.redFlag }], ["obstacle", { grid: CODE.obstacle }],
  ["remembered", { grid: "?", known: GROUND }], ["never seen", { grid: "?" }],
];

/** A list of signs, each as [meaning, the scene of one cell]. */
export function listSigns(signs) {
  return h("ul", { class: "legend" }, signs.map(([meaning, scene]) => {
    const board = new Board({ side: 1 }, "");
    board.canvas.setAttribute("aria-hidden", "true");
    board.show(scene);
    return h("li", {}, board.canvas, meaning);
  }));
}

export class Legend {
  constructor(isOfBot) {
    this.element = listSigns([...SIGNS, ...(isOfBot ? [BOT_SIGN] : [])]);
    this.element.append(h("li", {}, "Capitals are blue's, small letters red's. Point at a unit for its sight and its reach."));
  }
}

/** A list of keys over the page. */
export class KeysDialog {
  constructor(keys) {
    this.element = h("dialog", { "aria-label": "Keys" }, h("h2", {}, "Keys"),
      h("dl", {}, keys.flatMap(([key, what]) => [h("dt", {}, h("kbd", {}, key)), h("dd", {}, what)])),
      h("button", { type: "button", onclick: () => this.toggle() }, "Close"));
  }

  toggle() {
    if (this.element.open) this.element.close();
    else this.element.showModal();
  }
}
