// A match: Figure 2 of the paper, live or replayed. A team's fogged board stands beside the truth.
import { ask, connect, formatEnding, h, route, spectatorKey } from "./dom.js";
import { Downloads, embedding } from "./downloads.js";
import { MatchView } from "./replay.js";

const FORMS = ["journal", "html", "gif"];
const AGAIN_MS = 1000;
const MOST_TRIES = 12;

export function show(main, match) {
  const query = new URLSearchParams(location.search);
  new MatchPage(main, match, query.get("league"), query.get("identity")).begin();
}

class MatchPage extends MatchView {
  constructor(main, match, league, identity) {
    super(main);
    this.match = match;
    this.query = league ? { league, identity: identity ?? "" } : {};
    this.source = league ? route("league_replay", this.query) : route("replay", { match });
    this.isOfLeague = league !== null;
    this.back = league ? ["/league", "leaderboard"] : ["/", "lobby"];
    this.announce("Looking for the match...");
    this.ending = null;
  }

  begin() {
    this.early = ask(this.source); // most matches are over, and then nobody waits until that is known
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
    if (kind !== "absent") this.early = null;
    if (kind === "absent") {
      this.isGone = true;
      this.replay(this.player || this.ending ? MOST_TRIES : 1);
    } else if (kind === "rules") {
      this.rules = message.rules;
      this.delay = spectatorKey.get() ? 0 : message.public_delay;
      if (this.delay) this.announce(`The match runs. This pit shows its boards to everyone, ${this.delay} ticks late; they come with tick ${this.delay}.`);
      else this.announce(spectatorKey.get() ? "The match runs; its boards come with the next tick." :
        "The match runs. Until it is over only holders of the spectator key see its boards; this page shows what everyone may know.");
    } else if (kind === "wrong key") {
      this.isKeyWrong = true;
      this.announce(`Wrong key: ${message.sentence}. The lobby takes another.`, true);
    } else if (kind === "lost") {
      this.announce(`The pit is away: ${message.sentence}. Looking for it...`, true);
    } else if (kind === "public") {
      this.names = message.names ?? this.names;
      if (!this.delay || !this.player) this.showFacts(message, this.rules); // else they are of the board that is shown
    } else if (kind === "frame") {
      if (!this.player) this.makePlayer({ rules: this.rules, ticks: [], names: this.names, ending: null });
      this.player.add(message);
      this.announce(this.delay ? `The match runs. This pit shows its boards to everyone, ${this.delay} ticks late.` : "The match runs, and this page sees it with the spectator key.");
    } else if (kind === "ended") {
      this.ending = message.ending;
      this.announce(`Over: ${formatEnding(message.ending)}. Waiting for its journal...`);
      this.replay(MOST_TRIES);
    }
  }

  async replay(tries) {
    const answer = await (this.early ?? ask(this.source));
    this.early = null;
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
    super.showReplay(data);
    if (this.player) this.stage.append(new Downloads(this.player, (form, query) => ask(route("download", { match: this.match, form, ...this.query, ...query })), FORMS).element);
    if (this.player && !this.isOfLeague) this.stage.append(embedding(this.match));
  }

  announce(sentence, isBad = false) {
    if (this.isKeyWrong && sentence.startsWith("The match runs")) return;
    super.announce(sentence, isBad);
  }
}
