"""One match with its seats' keys: sealed messages and the time go in, effects come out."""

from collections import Counter, deque
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import partial

from arena.errors import ForgedError, ReplayedError, UnreadableError
from arena.game.ruleset import rules_values
from arena.game.types import Team, Termination
from arena.match.effects import Ask, End, Publish, Write
from arena.match.effects import Effect as MatchEffect
from arena.match.match import Match
from arena.pit.bundles import BundleLane
from arena.pit.effects import Append, CloseMatch, Effect, OpenMatch, PublishEnding, PublishTick, Send
from arena.policy import MatchResult
from arena.protocol.bundles import seat_number
from arena.protocol.codec import decode, encode
from arena.protocol.handshake import Caller, new_secret
from arena.protocol.identity import Identity
from arena.protocol.messages import (
    Commitment,
    Ended,
    History,
    Message,
    Orders,
    PastTruth,
    PublicState,
    Ready,
    Receipt,
    Signed,
    Ticket,
    Truth,
    Turn,
)
from arena.protocol.sealing import Opener, Sealer, truth_sealer
from arena.protocol.signed import check_receipt, commit, sign_journal, sign_statement
from arena.records.journal import journal_name, write_receipt, write_seats, write_signature
from arena.records.plan import network_name

MOST_REJECTED = 512
"""Messages of a seat that are forged or come again, between two calls of `try_again`; no more of them are tried, or counted."""
_MOST_FORMER = 2
"""Keys of former tickets by which messages that were still on their way are known for what they are."""
_HISTORY_BYTES = 50_000
_TURN_EXTRA_BYTES = 32
"""What a `Turn` is longer than its observation, at most."""
_NOTHING_SENT = (-1, b"")


@dataclass(frozen=True, slots=True, kw_only=True)
class PitContext:
    """What all matches of a pit share."""

    pit: str
    identity: Identity
    spectator_key: bytes | None = None
    public_delay: int = 0
    """Ticks after which everyone is shown the board of a match that runs; 0 shows it to nobody."""


@dataclass(slots=True)
class SeatSession:
    """A seat of the match, and the keys of the process that holds it."""

    name: str
    entry: bytes
    """The public key that it belongs to."""
    sealer: Sealer | None = None
    opener: Opener | None = None
    sent: tuple[int, bytes] = _NOTHING_SENT
    """The last turn as it was sealed: a resend under one key repeats it."""
    former: tuple[Opener, ...] = ()
    """Those of the last tickets before, at first of the lane's former match; what they open is not forged, and does not count."""
    accepted: bytes = b""
    """The last message that opened; a copy of it counts for nothing."""
    has_had_history: bool = False
    """Under this ticket."""
    n_rejected: int = 0
    """Messages that were forged or came again since `try_again` was called last."""
    receipt: Receipt | None = None
    bundles: BundleLane | None = None
    """Where its messages go; None if they go one by one."""

    @property
    def openers(self) -> tuple[Opener, ...]:
        """The present one, and the last before it."""
        return (*(() if self.opener is None else (self.opener,)), *self.former)[:_MOST_FORMER]


class MatchSession:
    """A match of a pit, from its drawn board to its signed journal."""

    def __init__(
        self,
        context: PitContext,
        match: Match,
        entries: dict[Team, bytes],
        nonce: bytes,
        lane: int,
        former: Mapping[Team, tuple[Opener, ...]],
    ) -> None:
        self.match, self._context, self.lane = match, context, lane
        self.entries = entries
        """Public keys of those who play."""
        self.id = network_name(match.header.identity, context.identity.public, nonce)
        self.due_s = 0.0
        """Before then, `advance` need not be called; 0 after anything was received."""
        self.ending: Signed | None = None
        """How the match ended, as both seats and everyone else get it."""
        self.names = [match.header.blue, match.header.red]
        self.seats = {
            team: SeatSession(name, entries[team], former=former.get(team, ()))
            for team, name in zip(Team, self.names, strict=True)
        }
        commitment = sign_statement(context.identity, Commitment(match=self.id, digest=commit(self.id, match.header.keys)))
        self._commitment = encode(commitment)
        self._seats_record = write_seats(context.identity.public, entries, commitment.signature, nonce)
        self._unwritten = b""
        """What the journal begins with, until there is something to write behind it."""
        make_truth = None
        if context.spectator_key is not None:
            salt = new_secret()
            make_truth = partial(self._make_truth, salt, truth_sealer(context.spectator_key, salt, context.pit, self.id))
        self._publish_tick = PublishTick(self.id, self._make_public, make_truth)
        self._past: deque[PastTruth] = deque(maxlen=context.public_delay + 1)
        """The last ticks, where they are shown with a delay."""

    @property
    def openers(self) -> dict[Team, tuple[Opener, ...]]:
        """What opens messages of those who hold the seats, or held them last."""
        return {team: seat.openers for team, seat in self.seats.items()}

    @property
    def tick(self) -> int:
        """Ticks played so far."""
        return self.match.tick

    def faults(self) -> dict[str, int]:
        """Return what was counted of both seats."""
        return dict(sum((Counter(self.match.record(team).faults()) for team in Team), Counter()))

    @property
    def has_receipts(self) -> bool:
        """Whether both seats gave theirs."""
        return all(seat.receipt is not None for seat in self.seats.values())

    @property
    def has_journal(self) -> bool:
        """Whether anything was written: a match that is void before its first tick leaves nothing."""
        return not self._unwritten

    def open(self) -> list[Effect]:
        """Open the channels; the journal is written from the first tick on."""
        self._unwritten = self.match.start_record + self._seats_record
        return [OpenMatch(self.id, journal_name(self.match.header.identity), 0, self.lane)]

    def issue_ticket(self, team: Team, caller: Caller, bundles: BundleLane | None = None) -> Ticket:
        """Give a seat to a caller, under new keys; those of the process that had it before hold no more."""
        time_control, seat, secret = self.match.time_control, self.seats[team], new_secret()
        n_bytes = self.match.n_shown_bytes(team) + _TURN_EXTRA_BYTES
        seat.former = seat.openers
        seat.sealer, seat.opener = caller.sit(self.id, team, secret, n_bytes)
        seat.sent, seat.has_had_history, seat.bundles = _NOTHING_SENT, False, bundles
        return Ticket(
            match=self.id,
            lane=self.lane,
            team=int(team),
            ruleset=rules_values(self.match.header.ruleset),
            opponent=self.seats[team.other].name,
            turn_time_s=time_control.turn_time_s,
            bank_s=time_control.bank_s,
            tick=self.match.tick,
            secret=secret,
            commitment=self._commitment,
            public_delay=self._context.public_delay,
            bundle_lane=None if bundles is None else bundles.number,
        )

    def receive(self, team: Team, payload: bytes, now_s: float, arrived_s: float | None = None) -> list[Effect]:
        """Take a message on a seat's key, which came at `arrived_s`. Junk is counted, and uses up nothing of the seat's."""
        message = self._open(team, payload)
        if type(message) is Orders:
            match_effects = self.match.submit(team, message.tick, message.actions, now_s, arrived_s)
            return self.carry(match_effects) if match_effects else []
        if type(message) is Ready:
            return self._welcome(team, max(message.known_ticks, 0), now_s)
        if message is not None:
            self.match.count_garbled(team)
        return []

    def receive_receipt(self, team: Team, payload: bytes) -> list[Effect]:
        """Take a message after the match; all but a seat's first receipt is ignored."""
        message, seat = self._open(team, payload), self.seats[team]
        if type(message) is not Receipt or seat.receipt is not None:
            return []
        try:
            check_receipt(seat.entry, self.id, team, message)
        except ForgedError:
            return []
        seat.receipt = message
        return [Append(self.id, write_receipt(team, message))] if self.has_journal else []

    def advance(self, now_s: float) -> list[Effect]:
        """Let time pass."""
        self.try_again()
        effects = self.carry(self.match.advance(now_s))
        self.due_s = self.match.due_s
        return effects

    def try_again(self) -> None:
        """Try messages again on keys on which too many were forged or came again."""
        for seat in self.seats.values():
            seat.n_rejected = 0

    def carry(self, match_effects: Iterable[MatchEffect]) -> list[Effect]:
        """Return what the pit is to do for what the match wants done."""
        effects: list[Effect] = []
        for effect in match_effects:
            if type(effect) is Ask:
                effects += self._ask(effect)
            elif type(effect) is Write:
                effects += self._write(effect.data)
            elif type(effect) is Publish:
                effects.append(self._publish())
            elif type(effect) is End:
                effects += self._end(effect.result)
        return effects

    def close(self) -> list[Effect]:
        """Sign the journal of a match that is over."""
        signature = write_signature(sign_journal(self._context.identity, self.match.head))
        return [*([Append(self.id, signature)] if self.has_journal else []), CloseMatch(self.id)]

    def _publish(self) -> PublishTick:
        """Return what is to be published of this tick, and of the one that everyone may be shown now."""
        if not self._context.public_delay:
            return self._publish_tick
        board, seen = self.match.truth()
        self._past.append(PastTruth(match=self.id, tick=self.match.tick, board=board, seen=seen))
        past = self._past[0]
        if self.match.tick - past.tick < self._context.public_delay:
            return self._publish_tick
        return self._publish_tick._replace(make_past_truth=lambda: encode(sign_statement(self._context.identity, past)))

    def _write(self, data: bytes) -> list[Effect]:
        result = self.match.result
        if self._unwritten and result is not None and result.ending is Termination.VOID and not self.match.tick:
            return []
        data, self._unwritten = self._unwritten + data, b""
        return [Append(self.id, data)]

    def _open(self, team: Team, payload: bytes) -> Message | None:
        seat = self.seats[team]
        if seat.opener is None or seat.n_rejected >= MOST_REJECTED or payload == seat.accepted:
            return None
        try:
            data = seat.opener.open(payload)
        except ReplayedError:
            seat.n_rejected += 1
            return None
        except ForgedError:
            seat.n_rejected += 1
            if not any(opener.has_sealed(payload) for opener in seat.former):
                self.match.count_forged(team)
            return None
        seat.accepted = payload
        try:
            return decode(data)
        except UnreadableError:
            self.match.count_garbled(team)
            return None

    def _ask(self, ask: Ask) -> list[Effect]:
        seat = self.seats[ask.team]
        if seat.sealer is None:
            return []
        if seat.sent[0] != ask.tick:
            turn = Turn(tick=ask.tick, observation=ask.observation, charged_us=ask.charged_us)
            seat.sent = ask.tick, seat.sealer.close(encode(turn), ask.tick)
        if seat.bundles is None:
            return [Send(self.id, ask.team, seat.sent[1])]
        if ask.is_new:
            seat.bundles.begin_clock(self.match, ask.team)
        seat.bundles.add(seat_number(self.lane, ask.team), seat.sent[1])
        return []

    def _welcome(self, team: Team, known: int, now_s: float) -> list[Effect]:
        """A seat is there and has `known` observations: ask it, or send it those that it lacks, once a ticket."""
        n_missed = self.match.tick - known
        if n_missed <= 0:
            return self.carry(self.match.ready(team, now_s))
        if self.seats[team].has_had_history:
            self.match.count_stale(team)
            return []
        self.seats[team].has_had_history = True
        return [*self._send_history(team, known), *self.carry(self.match.catch_up(team, n_missed, now_s))]

    def _send_history(self, team: Team, known: int) -> list[Effect]:
        """Send what a seat was shown before it came back, in pieces that fit a message."""
        observations, orders = self.match.history(team, known)
        step = max(1, _HISTORY_BYTES // (len(observations[0]) + len(orders[0]) + 8))
        self.seats[team].sent = _NOTHING_SENT  # as sealed before, the turn would have a lower count than the history
        return [
            effect
            for first in range(0, len(observations), step)
            for effect in self._send(
                team,
                History(
                    first_tick=known + first,
                    observations=observations[first : first + step],
                    orders=orders[first : first + step],
                    end_tick=self.match.tick,
                ),
            )
        ]

    def _send(self, team: Team, message: Message) -> list[Effect]:
        seat = self.seats[team]
        if seat.sealer is None:
            return []
        sealed = seat.sealer.close(encode(message), self.match.tick)
        if seat.bundles is None:
            return [Send(self.id, team, sealed)]
        seat.bundles.add(seat_number(self.lane, team), sealed)
        return []

    def _end(self, result: MatchResult) -> list[Effect]:
        ended = Ended(
            match=self.id,
            **result.to_dict(),
            faults={team.name.lower(): self.match.record(team).faults() for team in Team},
        )
        self.ending = sign_statement(self._context.identity, ended)
        sent = [effect for team in Team for effect in self._send(team, self.ending)]
        return [*sent, PublishEnding(self.id, encode(self.ending))]

    def _make_public(self) -> bytes:
        blue, red, score = self.match.facts
        return encode(
            PublicState(tick=self.match.tick, names=self.names, living=[blue, red], score=score, commitment=self._commitment)
        )

    def _make_truth(self, salt: bytes, sealer: Sealer) -> bytes:
        tick = self.match.tick
        board, seen = self.match.truth()
        return salt + sealer.close(encode(Truth(tick=tick, board=board, seen=seen)), tick)
