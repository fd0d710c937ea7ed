// A match on a page: who plays, how it stands or ended, and its boards. Whether it runs, was played or was opened from a file.
import { keepPlace, readPlace } from "./address.js";
import { TEAMS } from "./board.js";
import { fill, formatEnding, h, setText, signed } from "./dom.js";
import { Player } from "./player.js";

export class MatchView {
  constructor(main) {
    this.title = h("h1", {}, "Match");
    this.state = h("p", { class: "state", role: "status" }, "");
    this.facts = h("div", { class: "score", role: "status" });
    this.stage = h("div");
    main.append(this.title, this.state, this.facts, this.stage);
    this.names = ["?", "?"];
  }

  /** Show a match that is over, or what a seat saw of one. */
  showReplay(data) {
    this.names = data.names;
    this.clear();
    if (data.broken) {
      const where = data.broken.tick ? `at tick ${data.broken.tick}` : "at its start";
      this.stage.append(h("p", { class: "banner bad", role: "alert" },
        `This replay does not verify: it breaks ${where}. ${data.broken.sentence}`));
    }
    this.announce(describeReplay(data), Boolean(data.broken));
    if (!data.ticks.length) return;
    this.makePlayer(data);
    this.player.isWhole = true;
    this.player.go(readPlace().tick);
  }

  clear() {
    this.player?.stop();
    this.player = null;
    this.stage.replaceChildren();
    this.facts.replaceChildren();
  }

  makePlayer(data) {
    this.showTitle();
    this.player = new Player(this.stage, data, {
      view: readPlace().view,
      onTick: (tick) => this.showFacts(tick),
      onMove: () => keepPlace(this.player.data.ticks[this.player.at].tick, this.player.chosen),
    });
  }

  showTitle() {
    document.title = `${this.names[0]} against ${this.names[1]} - Arena`;
    fill(this.title, h("span", { class: "blue" }, this.names[0]), " against ", h("span", { class: "red" }, this.names[1]));
  }

  showFacts({ tick, living, score, charged_us: charged }, rules = this.player?.data.rules) {
    this.showTitle();
    this.facts.setAttribute("aria-live", this.player?.isPlaying ? "off" : "polite"); // sixty ticks a second are not read out
    fill(this.facts,
      h("span", {}, `tick ${tick}${rules?.tick_limit ? ` of ${rules.tick_limit}` : ""}`),
      score === null ? null : h("span", {}, `score ${signed(score)} for blue`),
      ...(living ?? []).map((n, team) => h("span", { class: TEAMS[team] }, `${TEAMS[team]} ${n} units`)),
      charged == null ? null : h("span", {}, `charged ${(charged / 1e6).toFixed(3)} s`));
  }

  announce(sentence, isBad = false) {
    setText(this.state, sentence);
    this.state.classList.toggle("bad", isBad);
  }
}

function describeReplay({ ending, broken, names, team, ticks }) {
  if (team === undefined) return `Over: ${formatEnding(ending)}.${broken ? "" : " Every tick was played again and holds."}`;
  const seen = `What ${names[team]} saw as ${TEAMS[team]}.`;
  return ending ? `${seen} Over: ${formatEnding(ending)}.` : `${seen} It stops after ${ticks.length} ticks, without an ending.`;
}
