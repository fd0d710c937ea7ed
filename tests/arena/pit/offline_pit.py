"""Both ends of a pit without a network, a clock or a file: a core whose effects are carried out in memory, and its clients."""

from collections import defaultdict
from collections.abc import Callable
from dataclasses import replace
from typing import Any

from arena.errors import ForgedError
from arena.game.keys import MatchKeys, derive_map_key, derive_match_key, secret_from_seed
from arena.game.ruleset import Ruleset, load
from arena.game.types import RULES_VERSION, Team
from arena.match.time_control import TimeControl
from arena.pit.core import PitCore
from arena.pit.effects import (
    Append,
    CloseMatch,
    Drop,
    Effect,
    MatchEnded,
    OpenMatch,
    PublishEnding,
    PublishTick,
    Reply,
    ReplyWithJournal,
    SaveRegister,
    Send,
    SendBundle,
)
from arena.pit.events import (
    ActionReceived,
    ActionsTaken,
    Event,
    JoinAsked,
    JournalAsked,
    LobbyAsked,
    PresenceChanged,
    RequestOpened,
    RequestTurn,
    TimePassed,
)
from arena.pit.match_session import PitContext
from arena.pit.register import Register
from arena.pit.seating import OpenSeating, Seating
from arena.protocol.bundles import read_bundle, read_seat_number
from arena.protocol.codec import decode, encode
from arena.protocol.handshake import Attempt, Request
from arena.protocol.identity import Identity
from arena.protocol.messages import (
    AdminRequest,
    Challenge,
    ChallengeRequest,
    Ended,
    History,
    JoinRequest,
    JournalRequest,
    Message,
    Orders,
    Ready,
    Signed,
    Ticket,
    Turn,
)
from arena.protocol.sealing import Opener, Sealer
from arena.protocol.signed import read_statement, sign_receipt
from arena.records.journal import read_journal, whole_part
from arena.records.plan import MatchPlan
from arena.records.transcript import Head

RULES = load("paper").with_({"side": 10, "tick_limit": 6})
N_UNITS = len(RULES.team(Team.BLUE))
PIT = Identity.make()
SWEEP_S = 0.01


def plan(identity: str, blue: str, red: str) -> MatchPlan:
    secret = secret_from_seed(2)
    keys = MatchKeys(map_key=derive_map_key(secret, identity, 0), match_key=derive_match_key(secret, identity))
    return MatchPlan(identity=identity, blue=blue, red=red, keys=keys)


class OfflinePit:
    """A core, and the world as its effects have made it."""

    def __init__(
        self,
        seating: Seating | None = None,
        *,
        ruleset: Ruleset = RULES,
        time_control: TimeControl | None = None,
        n_matches: int | None = None,
        register: Register | None = None,
        spectator_key: bytes | None = None,
        public_delay: int = 0,
        most_matches: int | None = None,
    ) -> None:
        self.now_s, self.n_begun = 1_000.0, 0
        self.seating = seating or OpenSeating(self._plan, n_matches)
        self.register = register or Register(names={"owned": b"o" * 32})
        context = PitContext(pit="pit", identity=PIT, spectator_key=spectator_key, public_delay=public_delay)
        self.core = PitCore(
            context, ruleset, self.seating, time_control or TimeControl(), self.register, most_matches=most_matches
        )
        self.opening_s: Callable[[], float] = lambda: 0.0
        """What it takes to open the next request."""
        self.replies: dict[int, bytes | None] = {}
        """By question; None was dropped."""
        self.n_asked = 0
        self.files: dict[str, str] = {}
        """By match that is open: its journal."""
        self.lanes: dict[int, str] = {}
        """The match of each."""
        self.journals: dict[str, bytes] = {}
        self.sent: dict[tuple[str, Team], list[bytes]] = defaultdict(list)
        self.bundles: dict[int, list[bytes]] = defaultdict(list)
        """By lane."""
        self.public: dict[str, list[bytes]] = defaultdict(list)
        self.truths: dict[str, list[bytes]] = defaultdict(list)
        self.ended: list[MatchEnded] = []
        self.n_saved = 0

    def _plan(self, blue: str, red: str) -> MatchPlan:
        self.n_begun += 1
        return plan(f"pit/{self.n_begun}", blue, red)

    def successor(self) -> "OfflinePit":
        """Return another pit, which finds the journals of this one."""
        later = OfflinePit()
        later.journals = dict(self.journals)
        return later

    def do(self, event: Event) -> list[Effect]:
        """Hand an event in, and carry out what comes of it."""
        effects = self.core.receive(event, self.now_s)
        for effect in effects:
            self._carry_out(effect)
        return effects

    def _carry_out(self, effect: Any) -> None:
        match effect:
            case Reply(question, payload):
                self._answer(question, payload)
            case Drop(question):
                self._answer(question, None)
            case ReplyWithJournal(question, journal, offset):
                self._answer(question, self.journals[journal][offset:])
            case OpenMatch(match, journal, n_bytes, lane):
                assert match not in self.files
                self.files[match], self.lanes[lane] = journal, match
                if n_bytes:
                    self.journals[journal] = self.journals[journal][:n_bytes]
            case Append(match, data):
                self.journals[self.files[match]] = self.journals.get(self.files[match], b"") + data
            case Send(match, team, payload):
                self._send(match, team, payload)
            case SendBundle(lane, payload):
                self.bundles[lane].append(payload)
                for number, message in read_bundle(payload):
                    lane_of_seat, team = read_seat_number(number)
                    self._send(self.lanes[lane_of_seat], team, message)
            case PublishTick(match, make_public, make_truth):
                self.public[match].append(make_public())
                if make_truth is not None:
                    self.truths[match].append(make_truth())
            case PublishEnding(match, payload):
                self.public[match].append(payload)
            case CloseMatch(match):
                del self.files[match]
            case MatchEnded():
                self.ended.append(effect)
            case SaveRegister():
                self.register.save()
                self.n_saved += 1

    def _send(self, match: str, team: Team, payload: bytes) -> None:
        self._check_written_ahead(match, int.from_bytes(payload[8:12], "big"))
        self.sent[match, team].append(payload)

    def _answer(self, question: int, payload: bytes | None) -> None:
        assert question < self.n_asked
        assert question not in self.replies, "a question is answered once"
        self.replies[question] = payload

    def _check_written_ahead(self, match: str, tick: int) -> None:
        """Check that the ticks before one stand in the journal, which begins with the first."""
        if not tick:
            return
        journal = read_journal(whole_part(self.journals[self.files[match]]))
        assert len(journal.ticks) >= tick, f"tick {tick} was sent before the one before it was written"

    def ask(self, make_event: Callable[[int], Event]) -> int:
        """Ask, and return what names the question."""
        self.n_asked += 1
        self.do(make_event(self.n_asked - 1))
        return self.n_asked - 1

    def ask_to_join(self, payload: bytes) -> int:
        return self.ask(lambda question: JoinAsked(question, payload))

    def reply(self, question: int) -> Message | None:
        payload = self.replies.get(question)
        return None if payload is None else decode(payload)

    def challenge(self) -> Challenge:
        challenge = self.reply(self.ask_to_join(encode(ChallengeRequest())))
        assert isinstance(challenge, Challenge)
        return challenge

    def lobby(self) -> Any:
        signed = self.reply(self.ask(LobbyAsked))
        assert isinstance(signed, Signed)
        return read_statement(signed, PIT.public)

    def ask_for_journal(self, match: str, offset: int = 0) -> int:
        question = self.ask(lambda question: JournalAsked(question, match, encode(JournalRequest(offset=offset))))
        self._open_requests()
        return question

    def pass_time(self, passed_s: float = SWEEP_S) -> None:
        """Let time pass, and then open requests as the shell does."""
        self.now_s += passed_s
        self.do(TimePassed(self.now_s))
        self._open_requests()

    def _open_requests(self) -> None:
        while self.core.may_open_request:
            self.do(RequestTurn())
            took_s = self.opening_s()
            self.now_s += took_s
            self.do(RequestOpened(took_s))


class Player:
    """A client process with one slot."""

    def __init__(self, pit: OfflinePit, name: str, identity: Identity | None = None, client: str = "") -> None:
        self.pit, self.name = pit, name
        self.identity = identity or Identity.make()
        self.client = client or f"of-{name}"
        self.attempt: Attempt
        self.question: int
        self.ticket: Ticket
        self.sealer: Sealer
        self.opener: Opener
        self.shown: list[bytes] = []
        self._n_read = 0
        self._is_gone = False

    # Admission

    def join_request(self, **changes: Any) -> JoinRequest:
        plain = JoinRequest(rules_version=RULES_VERSION, name=self.name, team="any", client=self.client, slot=0)
        return replace(plain, **changes)

    def send_request(self, request: Request | None = None, **changes: Any) -> "Player":
        """Send a sealed request; the pit has still to open it. Who had vanished is back by that."""
        if self._is_gone:
            self._is_gone = False
            self.pit.do(PresenceChanged(self.client, True))
        self.attempt = Attempt(self.identity, "pit", self.pit.challenge(), request or self.join_request(**changes))
        self.question = self.pit.ask_to_join(self.attempt.sealed)
        return self

    def ask(self, **changes: Any) -> Message | None:
        """Ask for a seat, and return what is answered at once."""
        self.send_request(**changes).pit.pass_time()
        return self.answer()

    def command(self, command: str, target: str = "") -> Message | None:
        self.send_request(AdminRequest(command=command, target=target)).pit.pass_time()
        return self.answer()

    def answer(self) -> Message | None:
        """Return the answer, which nobody else can read; None while there is none."""
        payload = self.pit.replies.get(self.question)
        return None if payload is None else self.attempt.open(payload)

    def join(self, **changes: Any) -> "Player":
        """Ask for a seat and take it."""
        self.ask(**changes)
        return self.take()

    def take(self) -> "Player":
        """Take the seat that was given."""
        ticket = self.answer()
        assert isinstance(ticket, Ticket), ticket
        if hasattr(self, "ticket") and self.ticket.match != ticket.match:
            self.shown, self._n_read = [], 0
        self.ticket = ticket
        self.sealer, self.opener = self.attempt.sit(ticket.match, self.team, ticket.secret)
        return self

    # At a seat

    @property
    def team(self) -> Team:
        return Team(self.ticket.team)

    @property
    def place(self) -> tuple[str, Team]:
        return self.ticket.match, self.team

    def put(self, data: bytes) -> list[Effect]:
        effects = self.pit.do(ActionReceived(self.ticket.lane, self.team, data))
        return effects + self.pit.do(ActionsTaken())

    def send(self, message: Message, tick: int = 0) -> "Player":
        self.put(self.sealer.close(encode(message), tick))
        return self

    def ready(self) -> "Player":
        return self.send(Ready(known_ticks=len(self.shown)))

    def order(self, actions: bytes = bytes(N_UNITS)) -> "Player":
        """Answer the turn that was shown last."""
        tick = max(len(self.shown) - 1, 0)
        return self.send(Orders(tick=tick, actions=actions), tick)

    def read(self) -> list[Message]:
        """Return what was received since the last call, as far as it opens; keep what was shown."""
        messages = self.pit.sent[self.place]
        new, self._n_read = messages[self._n_read :], len(messages)
        return [self._take_in(message) for data in new if (message := self._open(data)) is not None]

    def _open(self, data: bytes) -> Message | None:
        try:
            return decode(self.opener.open(data))
        except ForgedError:
            return None

    def _take_in(self, message: Message) -> Message:
        if isinstance(message, Turn) and message.tick == len(self.shown):
            self.shown.append(message.observation)
        elif isinstance(message, History):
            self.shown[message.first_tick :] = message.observations
            if len(self.shown) == message.end_tick:
                self.ready()
        elif isinstance(message, Signed):
            ended = read_statement(message, PIT.public)
            assert isinstance(ended, Ended)
            return ended
        return message

    def give_receipt(self) -> "Player":
        head = Head()
        for observation in self.shown:
            head.add(observation)
        return self.send(sign_receipt(self.identity, self.ticket.match, self.team, len(self.shown), head.digest))

    def vanish(self) -> None:
        self._is_gone = True
        self.pit.do(PresenceChanged(self.client, False))


def begin(pit: OfflinePit, blue: str = "ann", red: str = "bob") -> tuple[Player, Player]:
    """Let two entries begin a match."""
    ann, bob = Player(pit, blue), Player(pit, red)
    assert ann.ask() is None
    bob.join()
    return ann.take(), bob


def play(*players: Player, n_ticks: int = RULES.tick_limit) -> list[Message]:
    """Get ready and play, every unit staying; return what the players received last."""
    for player in players:
        player.ready()
    last = [player.read() for player in players]
    for _ in range(n_ticks):
        for player in players:
            player.order()
        last = [player.read() for player in players]
    return [message for messages in last for message in messages]
