// The last match that can be shown, moving on a board: the truth, again and again.
import { Board } from "./board.js";
import { ask, fill, h, route, setText } from "./dom.js";

const TICK_MS = 250;
const PAUSE_TICKS = 12;
const AGAIN_MS = 5_000;
const MATCH = /^[\w-]+$/;

export class LastMatch {
  constructor() {
    this.says = h("p");
    this.stage = h("figure");
    this.button = h("button", { type: "button", onclick: () => this.toggle() });
    this.section = h("section", { class: "last", hidden: true }, h("h2", {}, "The last match"), this.says, this.stage, h("div", { class: "controls" }, this.button));
    this.isMoving = !matchMedia("(prefers-reduced-motion: reduce)").matches;
    this.shown = null;
    this.askedAt = -Infinity;
    this.showButton();
    setInterval(() => this.isMoving && !document.hidden && this.step(), TICK_MS);
  }

  /** Look for a later match among the pit's results; among the leagues while there is none. */
  async refresh(results) {
    const wanted = results.find(({ match }) => MATCH.test(match))?.match ?? "";
    if (wanted === this.shown || this.isAsking || performance.now() - this.askedAt < AGAIN_MS) return;
    this.isAsking = true;
    const [data, address] = wanted ? await this.ofPit(wanted) : await this.ofLeague();
    [this.isAsking, this.askedAt] = [false, performance.now()];
    if (!data?.ticks?.length) return;
    this.shown = wanted;
    this.play(data, address);
  }

  async ofPit(match) {
    return [await ask(route("replay", { match })), `/match/${encodeURIComponent(match)}`];
  }

  async ofLeague() {
    const { leagues } = await ask(route("leagues"));
    if (!leagues?.length) return [];
    const [league] = leagues;
    const { results } = await ask(route("league", { name: league }));
    if (!results?.length) return [];
    const { identity } = results.at(-1);
    return [await ask(route("league_replay", { league, identity })), `/match/replay?${new URLSearchParams({ league, identity })}`];
  }

  play(data, address) {
    this.data = data;
    const [blue, red] = data.names;
    fill(this.says, h("a", { href: address }, h("span", { class: "blue" }, blue), " against ", h("span", { class: "red" }, red)));
    if (this.board?.side !== data.rules.side) {
      this.board = new Board(data.rules, "");
      this.stage.replaceChildren(this.board.canvas);
    }
    this.board.label(`The last match, ${blue} against ${red}, played again`);
    this.section.hidden = false;
    this.at = this.isMoving ? 0 : data.ticks.length - 1;
    this.draw();
  }

  step() {
    if (!this.data) return;
    this.at = (this.at + 1) % (this.data.ticks.length + PAUSE_TICKS);
    this.draw();
  }

  draw() {
    const { ticks } = this.data;
    this.board.show({ grid: ticks[Math.min(this.at, ticks.length - 1)].truth });
  }

  toggle() {
    this.isMoving = !this.isMoving;
    this.showButton();
  }

  showButton() {
    setText(this.button, this.isMoving ? "Pause" : "Play");
  }
}
