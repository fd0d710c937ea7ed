// A match: Figure 2 of the paper, live or replayed. A team's fogged board stands beside the truth.
import { keepPlace, readPlace } from "./address.js";
import { TEAMS } from "./board.js";
import { ask, connect, fill, h, route, setText, signed, spectatorKey, formatEnding } from "./dom.js";
import { Player } from "./player.js";

const AGAIN_MS = 1000;
const MOST_TRIES = 12;

export function show(main, match) {
  const query = new URLSearchParams(location.search);
  new MatchPage(main, match, query.get("league"), query.get("identity")).begin();
}

class MatchPage {
  constructor(main, match, league, identity) {
    this.match = match;
    this.source = league
      ? route("league_replay", { league, identity: identity ?? "" })
      : route("replay", { match });
    this.isOfLeague = league !== null;
    this.back = league ? ["/league", "leaderboard"] : ["/", "lobby"];
    this.title = h("h1", {}, "Match");
    this.state = h("p", { class: "state", role: "status" }, "Looking for the match...");
    this.facts = h("div", { class: "score", role: "status" });
    this.stage = h("div");
    main.append(this.title, this.state, this.facts, this.stage);
    this.names = ["?", "?"];
    this.ending = null;
  }

  begin() {
    if (this.isOfLeague) this.replay(1);
    else this.listen();
  }

  listen() {
    this.isWatched = false;
    connect(route("watch_match", { match: this.match }), { key: spectatorKey.get() }, (message) => this.hear(message), () => {
      if (this.player?.isWhole || this.isGone || this.ending) return;
      this.announce("The web server is gone; looking for it...", true);
      setTimeout(() => this.listen(), AGAIN_MS);
    });
  }

  hear(message) {
    const { kind } = message;
    if (kind === "absent") {
      this.isGone = true;
      this.replay(this.player || this.ending ? MOST_TRIES : 1);
    } else if (kind === "rules") {
      this.rules = message.rules;
      this.announce(spectatorKey.get() ? "The match runs; its boards come with the next tick." :
        "The match runs. Until it is over only holders of the spectator key see its boards; this page shows what everyone may know.");
    } else if (kind === "wrong key") {
      this.isKeyWrong = true;
      this.announce(`Wrong key: ${message.sentence}. The lobby takes another.`, true);
    } else if (kind === "lost") {
      this.announce(`The pit is away: ${message.sentence}. Looking for it...`, true);
    } else if (kind === "public") {
      this.names = message.names ?? this.names;
      this.showFacts(message);
    } else if (kind === "frame") {
      this.player ??= this.makePlayer({ rules: this.rules, ticks: [], names: this.names, ending: null });
      this.player.add(message);
      this.announce("The match runs, and this page sees it with the spectator key.");
    } else if (kind === "ended") {
      this.ending = message.ending;
      this.announce(`Over: ${formatEnding(message.ending)}. Waiting for its journal...`);
      this.replay(MOST_TRIES);
    }
  }

  async replay(tries) {
    const answer = await ask(this.source);
    if (!answer.error) {
      this.showReplay(answer);
    } else if (tries > 1) {
      if (this.ending) this.announce(`Over: ${formatEnding(this.ending)}. Its boards: ${answer.error}.`);
      setTimeout(() => this.replay(tries - 1), AGAIN_MS);
    } else if (this.ending) {
      this.announce(`Over: ${formatEnding(this.ending)}. ${answer.error}.`, false);
    } else {
      this.announce(`This match cannot be shown: ${answer.error}.`, true);
      this.state.append(" ", h("a", { href: this.back[0] }, `To the ${this.back[1]}`));
    }
  }

  showReplay(data) {
    this.names = data.names;
    this.player?.stop();
    this.stage.replaceChildren();
    if (data.broken) {
      const where = data.broken.tick ? `at tick ${data.broken.tick}` : "at its start";
      this.stage.append(h("p", { class: "banner bad", role: "alert" },
        `This replay does not verify: it breaks ${where}. ${data.broken.sentence}`));
    }
    this.announce(`Over: ${formatEnding(data.ending)}.${data.broken ? "" : " Every tick was played again and holds."}`, Boolean(data.broken));
    if (!data.ticks.length) return;
    this.player = this.makePlayer(data);
    this.player.isWhole = true;
    this.player.go(readPlace().tick);
  }

  makePlayer(data) {
    this.showTitle();
    const player = new Player(this.stage, data, {
      view: readPlace().view,
      onTick: (tick) => this.showFacts(tick),
      onMove: () => keepPlace(player.data.ticks[player.at].tick, player.chosen),
    });
    return player;
  }

  showTitle() {
    document.title = `${this.names[0]} against ${this.names[1]} - Arena`;
    fill(this.title, h("span", { class: "blue" }, this.names[0]), " against ", h("span", { class: "red" }, this.names[1]));
  }

  showFacts({ tick, living, score }) {
    this.showTitle();
    const limit = (this.player?.data.rules ?? this.rules)?.tick_limit;
    this.facts.setAttribute("aria-live", this.player?.isPlaying ? "off" : "polite"); // sixty ticks a second are not read out
    fill(this.facts,
      h("span", {}, `tick ${tick}${limit ? ` of ${limit}` : ""}`),
      score === null ? null : h("span", {}, `score ${signed(score)} for blue`),
      ...(living ?? []).map((n, team) => h("span", { class: TEAMS[team] }, `${TEAMS[team]} ${n} units`)));
  }

  announce(sentence, isBad = false) {
    if (this.isKeyWrong && sentence.startsWith("The match runs")) return;
    setText(this.state, sentence);
    this.state.classList.toggle("bad", isBad);
  }
}
