// Play: a seat for a person. The fogged board, the units with their standing orders, and what each may do now.
import { Board, CODE, TEAMS } from "./board.js";
import { PLAY_SIGNS, listSigns } from "./legend.js";
import { ask, connect, fill, h, route, setText, signed, words } from "./dom.js";

const AGAIN_MS = 1000;
const HURRY_S = 10;
const NAMES = { north: "North", east: "East", south: "South", west: "West", stay: "Stay" };
const KEYS = {
  ArrowUp: 1, ArrowRight: 2, ArrowDown: 3, ArrowLeft: 4, w: 1, d: 2, s: 3, a: 4, ".": 0, x: 0,
};

export async function show(main) {
  document.title = "Play - Arena";
  const [offer, lobby] = await Promise.all([ask(route("play")), ask(route("lobby"))]);
  new PlayPage(main, offer, lobby).begin();
}

/** What is in sight of the enemy, and where the flag is that is looked for, in words. */
function formatSights({ team, side, grid, known }) {
  const [ugv, uav, flag] = team ? [CODE.blueUgv, CODE.blueUav, CODE.blueFlag] : [CODE.redUgv, CODE.redUav, CODE.redFlag];
  const find = (cells, code) => [...cells].flatMap((one, cell) => (one === code ? [`${Math.floor(cell / side)}, ${cell % side}`] : []));
  const enemies = [["UGV", ugv], ["UAV", uav]].flatMap(([name, code]) => find(grid, code).map((place) => `${name} at ${place}`));
  const [place] = find(known, flag);
  return `In sight: ${enemies.join("; ") || "no enemy"}. The flag to capture ${place ? `is at ${place}` : "is not found yet"}.`;
}

class PlayPage {
  constructor(main, offer, lobby) {
    this.offer = offer;
    this.needsInvite = lobby.lobby?.needs_invite ?? false;
    this.state = h("p", { class: "state", role: "status" });
    this.stage = h("div");
    main.append(h("h1", {}, "Play"), this.state, this.stage);
    document.addEventListener("keydown", (event) => this.press(event));
    this.stage.addEventListener("click", (event) => event.detail && event.target.closest("button")?.blur()); // Enter is the turn's
    setInterval(() => this.showTime(), 200);
  }

  begin() {
    const token = sessionStorage.getItem("seat");
    if (this.offer.error || !this.offer.is_open) this.announce(this.offer.error ?? "Nobody can play by this server. On your own machine, arena web lets you.", true);
    else if (token) this.listen({ token });
    else this.askWish();
  }

  askWish() {
    this.announce("Who plays, and against whom? The match begins when both seats are taken.");
    const name = h("input", { id: "name", value: localStorage.getItem("name") ?? "human", required: true, maxlength: 64, pattern: "[A-Za-z0-9_\\-]+", title: "letters, digits, - and _" });
    const team = h("select", { id: "team" }, ["any", ...TEAMS].map((value) => h("option", { value }, value)));
    const opponent = h("select", { id: "opponent" }, h("option", { value: "patrol" }, "patrol, an easy one"), h("option", { value: "" }, "whoever comes"),
      this.offer.fighters.filter((one) => one !== "patrol").map((one) => h("option", { value: one }, one)));
    const invite = this.needsInvite ? h("input", { id: "invite", required: true, autocomplete: "off" }) : null;
    const row = (label, field) => field && h("div", { class: "controls" }, h("label", { for: field.id, class: "label" }, label), field);
    const form = h("form", {}, row("Name", name), row("Team", team), row("Against", opponent), row("Invite code", invite), h("button", { class: "main" }, "Take a seat"));
    form.addEventListener("submit", (event) => {
      event.preventDefault();
      localStorage.setItem("name", name.value);
      this.listen({ name: name.value, team: team.value, opponent: opponent.value, invite: invite?.value ?? "" });
    });
    this.stage.replaceChildren(
      h("p", {}, "Your units see only what is near them, and so do the enemy's. Send one of those on the ground onto the enemy's flag, or beat all that are on the ground."),
      form);
    this.board = null;
  }

  listen(first) {
    this.isRefused = false;
    this.socket = connect(route("play_match"), first, (message) => this.hear(message), () => {
      if (this.isRefused || this.data?.kind === "over" || this.data?.kind === "failed") return;
      this.announce("The connection is lost; your seat waits. Connecting again...", true);
      setTimeout(() => this.listen({ token: sessionStorage.getItem("seat") }), AGAIN_MS);
    });
  }

  hear(message) {
    if (message.kind === "seat") {
      sessionStorage.setItem("seat", message.token);
    } else if (message.kind === "refused") {
      this.isRefused = true;
      sessionStorage.removeItem("seat");
      this.askWish();
      this.announce(`No seat: ${message.sentence}.`, true);
    } else {
      this.data = message;
      this.heardAt = performance.now();
      this.showTold();
    }
  }

  showTold() {
    const { data } = this;
    if (data.picture) this.showPicture();
    if (data.kind === "waiting") this.showWaiting();
    else if (data.kind === "turn") this.showTurn();
    else this.showEnd();
  }

  showWaiting() {
    this.announce(`${this.data.name} waits ${this.data.sentence || "for a seat"}. The lobby shows the command by which a bot joins.`);
    fill(this.stage, h("button", { type: "button", onclick: () => this.leave() }, "Leave"));
  }

  showTurn() {
    const { data } = this;
    if (data.sentence) this.announce(`You wait ${data.sentence}; your seat is kept.`, true);
    else this.announce(data.is_my_turn
      ? "Your turn: it ends with Enter, when every unit has its order, or when the time is over. Orders stay until you change them."
      : "The others move...");
  }

  showEnd() {
    const { data } = this;
    sessionStorage.removeItem("seat");
    const again = h("button", { type: "button", class: "main", onclick: () => { this.data = null; this.askWish(); } }, "Play again");
    if (data.kind === "failed") {
      this.announce(`The seat is gone: ${data.sentence}.`, true);
      this.stage.replaceChildren(again);
      return;
    }
    const { result } = data;
    const team = TEAMS[data.team];
    const outcome = result.ending === "void" ? "The match is void" : result.winner === null ? "A draw" : result.winner === team ? "You win" : "You lose";
    this.announce(`${outcome} by ${words(result.ending)}${result.reason ? ` (${result.reason})` : ""} after ${result.ticks} ticks, score ${signed(result.score)}.${data.verdict ? ` Checked: ${data.verdict}.` : ""}`);
    const watch = h("a", { href: `/match/${encodeURIComponent(data.match)}` }, "Watch it with the truth beside it");
    fill(data.picture ? this.after : this.stage, again, " ", watch); // there is no board of a match that ended before its first turn
  }

  build(picture) {
    const { side } = picture;
    this.board = new Board({ side }, "The board as your team sees it");
    this.who = h("div", { class: "parts" });
    this.facts = h("div", { class: "parts", role: "status" });
    this.time = h("b", { class: "time", role: "timer" }); // which is not read out by itself; `alarm` is, once a turn
    this.alarm = h("span", { class: "unseen", role: "status" });
    this.sights = h("p", { class: "events", role: "status" });
    this.units = h("ol", { class: "units" });
    this.options = h("div", { class: "pad" });
    this.after = h("div", { class: "controls" });
    this.memory = h("input", { type: "checkbox", id: "memory", checked: true, onchange: () => this.showPicture() });
    this.pilot = h("select", { id: "pilot", onchange: () => this.setText({ do: "autopilot", name: this.pilot.value }) },
      h("option", { value: "" }, "nobody: they stay"), this.offer.fighters.map((name) => h("option", { value: name }, name)));
    this.board.canvas.addEventListener("click", (event) => {
      const cell = this.board.cellAt(event.clientX, event.clientY);
      if (cell) this.setText({ do: "point", row: cell[0], column: cell[1] });
    });
    this.stage.replaceChildren(h("div", { class: "score" }, this.who, this.facts), this.after,
      h("div", { class: "controls clock" }, this.time, this.alarm, (this.end = h("button", { type: "button", class: "main", onclick: () => this.setText({ do: "end" }) }, "End turn (Enter)"))),
      h("div", { class: "desk" }, h("figure", {}, this.board.canvas, this.sights, listSigns(PLAY_SIGNS)),
        h("div", { class: "orders" }, h("h2", {}, "Orders for the chosen unit"), this.options), h("div", { class: "panel" },
        h("h2", {}, "Units"), this.units,
        h("div", { class: "controls" }, h("label", { for: "pilot" }, "Units without orders follow"), this.pilot),
        h("div", { class: "controls" }, this.memory, h("label", { for: "memory" }, "Show remembered ground")),
        h("p", { class: "hint" }, "Click a unit to choose it, then a cell to send it there. Keys: ",
          ...[["0 - 9", "choose,"], ["N", "next unit,"], ["arrows or WASD", "go,"], [".", "stay,"], ["Backspace", "take the order back,"], ["Enter", "end the turn."]]
            .flatMap(([key, what]) => [h("kbd", {}, key), ` ${what} `])))));
  }

  showPicture() {
    const { picture, opponent, autopilot } = this.data;
    if (!this.board || !this.board.canvas.isConnected) this.build(picture);
    const { units, selected } = picture;
    const chosen = units[selected];
    const own = TEAMS[picture.team];
    fill(this.who, h("span", { class: own }, `you are ${own}`), h("span", {}, `against ${opponent}`));
    fill(this.facts, h("span", {}, `tick ${picture.tick} of ${picture.tick_limit}`), h("span", {}, `score ${signed(picture.score)}`), h("span", {}, `units ${picture.living[0]} to ${picture.living[1]}`));
    this.board.show({
      grid: picture.grid,
      known: this.memory.checked ? picture.known : null,
      discs: chosen ? [{ cell: chosen.cell, sight: chosen.sight, reach: chosen.reach }] : [],
      routes: chosen?.route.length ? [[chosen.cell, ...chosen.route]] : [],
      numbers: units.flatMap((unit, index) => (unit.alive ? [{ cell: unit.cell, text: `${index}` }] : [])),
      steps: this.data.is_my_turn ? picture.options.flatMap(({ to, is_open: isOpen, name }) => (isOpen && name !== "stay" ? [to] : [])) : [],
      selected: chosen?.cell,
    });
    this.board.label(`The board at tick ${picture.tick} as ${own} sees it`);
    setText(this.sights, formatSights(picture));
    this.end.disabled = !this.data.is_my_turn;
    this.showUnits(units, selected);
    this.showOptions(picture);
    if (document.activeElement !== this.pilot) this.pilot.value = autopilot;
    this.showTime();
  }

  showUnits(units, selected) {
    if (this.units.children.length !== units.length) {
      this.units.replaceChildren(...units.map((_, index) => h("li", {}, h("button", { type: "button", onclick: () => this.setText({ do: "select", unit: index }) }))));
    }
    units.forEach((unit, index) => {
      const button = this.units.children[index].firstChild;
      setText(button, `${unit.type.toUpperCase()} at ${unit.cell.join(", ")}: ${unit.order}${unit.alive && unit.is_fresh ? " \u2713" : ""}`);
      button.setAttribute("aria-pressed", `${index === selected}`);
      button.disabled = !unit.alive;
    });
  }

  showOptions({ options, units, selected }) {
    if (!this.options.children.length) {
      const make = (action, name) => h("button", { type: "button", class: name, onclick: () => this.setText({ do: "order", action }) }, NAMES[name]);
      this.options.append(make(1, "north"), make(4, "west"), make(0, "stay"), make(2, "east"), make(3, "south"),
        h("button", { type: "button", class: "back", onclick: () => this.setText({ do: "release" }) }, "Take back"));
    }
    const isMine = this.data.is_my_turn && units[selected];
    for (const option of options) {
      const button = this.options.querySelector(`.${option.name}`);
      button.disabled = !isMine || !option.is_open;
      button.title = option.is_open ? `to row ${option.to[0]}, column ${option.to[1]}` : option.why;
    }
    this.options.querySelector(".back").disabled = !isMine;
  }

  showTime() {
    const left = this.data?.picture?.time_left_s;
    if (!this.time || left === undefined) return;
    if (this.data.kind !== "turn") {
      setText(this.time, "the match is over");
      return;
    }
    const seconds = left === null ? null : Math.max(0, left - (performance.now() - this.heardAt) / 1000);
    setText(this.time, seconds === null ? "no clock runs" : `${Math.ceil(seconds)} s left`);
    const isLate = seconds !== null && seconds < HURRY_S;
    this.time.classList.toggle("hurry", isLate);
    setText(this.alarm, isLate && this.data.is_my_turn ? `${HURRY_S} seconds are left` : "");
  }

  press(event) {
    const isTyping = event.target.closest?.("input, select, textarea");
    if (event.ctrlKey || event.metaKey || event.altKey || isTyping || this.data?.kind !== "turn") return;
    const key = event.key.length === 1 ? event.key.toLowerCase() : event.key;
    const isOnButton = Boolean(event.target.closest?.("button, a"));
    let word = null;
    if (key in KEYS) word = { do: "order", action: KEYS[key] };
    else if (/^[0-9]$/.test(key)) word = { do: "select", unit: Number(key) };
    else if (key === "n") word = { do: "next", by: event.shiftKey ? -1 : 1 };
    else if (key === "Backspace" || key === "Delete") word = { do: "release" };
    else if (key === "Enter" && !isOnButton) word = { do: "end" };
    if (!word) return;
    event.preventDefault();
    this.setText(word);
  }

  setText(word) {
    if (this.socket?.readyState === WebSocket.OPEN) this.socket.send(JSON.stringify(word));
  }

  leave() {
    this.setText({ do: "leave" });
    sessionStorage.removeItem("seat");
    this.isRefused = true;
    this.socket.close();
    this.data = null;
    this.askWish();
  }

  announce(sentence, isBad = false) {
    setText(this.state, sentence);
    this.state.classList.toggle("bad", isBad);
  }
}
