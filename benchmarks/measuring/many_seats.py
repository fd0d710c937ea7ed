"""Many seats of a pit in one light process: each answers every turn, at once or when it has waited, and nobody thinks.

What the referee says is not opened: the tick stands beside the seal. So a turn costs this process little, and what passes between
the later of the two orders of a turn and the next turn is the pit's own, and the network's.
"""

import heapq
import random
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from itertools import count
from queue import Empty, SimpleQueue

from arena.errors import ArenaError
from arena.game.ruleset import Ruleset
from arena.game.types import RULES_VERSION, Team
from arena.network.session import Put, Sample, Session, open_client, read_key, read_payload
from arena.protocol import topics
from arena.protocol.codec import encode
from arena.protocol.handshake import Attempt, read_challenge
from arena.protocol.identity import Identity
from arena.protocol.messages import ChallengeRequest, JoinRequest, Orders, Ready, Ticket, Wait
from arena.protocol.sealing import Sealer

PIT = "bench"
_SLOTS = 200
"""Of a client, as which some of the seats ask."""
_MOST_ASKED = 32
_MOST_WAITING = 100_000
_ANSWER_S = 10.0
_START_S = 120.0
_POLL_S = 0.0005


@dataclass(slots=True)
class _Pair:
    """The two seats of a match, as far as this process knows."""

    phase: float
    """Of its first turn, when its seats answer, so that not all matches do at once."""
    tick: int = -1
    n_answered: int = 0
    answered_at_s: float = 0.0
    """When the later of the two orders of this tick was sent."""
    n_turns: int = 0


@dataclass(slots=True)
class Seat:
    """A seat: how it answers."""

    lane: int
    team: Team
    put: Put
    seal: Callable[[int], bytes]
    """From the tick to the sealed orders."""
    say_ready: Callable[[], None]
    """Nothing where there is nobody to tell."""
    tick: int = -1


@dataclass(slots=True)
class Measured:
    """What was seen in one window of time."""

    n_turns: int = 0
    took_s: float = 0.0
    own_parts_s: list[float] = field(default_factory=list)
    """Of each turn: from the later of its orders to the next turn."""
    n_late: int = 0
    """Answers that this process gave too late, by its own fault."""


class ManySeats:
    """The seats, over one session.

    Parameters
    ----------
    pause_s
        How long a seat waits before it answers, at least and at most; both 0 answers at once.
    patience_s
        An answer that is given so much later than it was due is counted.
    """

    def __init__(self, endpoint: str, pause_s: tuple[float, float] = (0.0, 0.0), patience_s: float = 0.05) -> None:
        self._session: Session = open_client(endpoint)
        self._heard = self._session.collect(topics.all_observations(PIT), _MOST_WAITING)
        self._pause_s, self._patience_s = pause_s, patience_s
        self._seats: dict[str, Seat] = {}
        self._pairs: dict[int, _Pair] = {}
        self._due: list[tuple[float, int, Seat, int]] = []
        self._numbers = count()
        self._random = random.Random(0)
        self._measured = Measured()
        self._end_beat = self._session.heartbeat(topics.observation(PIT, 0, Team.BLUE), 0.01)

    def close(self) -> None:
        """Leave."""
        self._end_beat()
        self._session.__exit__(None, None, None)

    def add(self, lane: int, team: Team, seal: Callable[[int], bytes], make_ready: Callable[[], bytes] | None = None) -> Seat:
        """Hold a seat from now on."""
        put, _ = self._session.publisher(topics.action(PIT, lane, team))
        say_ready = (lambda: None) if make_ready is None else (lambda: put(make_ready()))
        seat = self._seats[topics.observation(PIT, lane, team)] = Seat(lane, team, put, seal, say_ready)
        self._pairs.setdefault(lane, _Pair(self._random.random()))
        return seat

    def join(self, n_seats: int, ruleset: Ruleset) -> None:
        """Take seats in a pit, which plays them against each other."""
        identity, actions = Identity.make(), bytes(len(ruleset.team(Team.BLUE)))
        clients = [f"c{number}" for number in range(-(-n_seats // _SLOTS))]
        for client in clients:
            self._session.declare_presence(topics.presence(PIT, "bench", client))
        answers: SimpleQueue[tuple[int, Attempt | None, bytes]] = SimpleQueue()
        wanted, n_asked, n_seated = list(reversed(range(n_seats))), 0, 0
        end_s = time.monotonic() + _START_S

        def ask(slot: int, payload: bytes, attempt: Attempt | None) -> None:
            key = topics.join(PIT)
            self._session.ask(key, payload, lambda answer: answers.put((slot, attempt, answer)), _ANSWER_S)

        while n_seated < n_seats:
            while wanted and n_asked < _MOST_ASKED:
                n_asked += 1
                ask(wanted.pop(), encode(ChallengeRequest()), None)
            try:
                slot, attempt, answer = answers.get(timeout=1.0)
            except Empty:
                if time.monotonic() > end_s:
                    raise ArenaError(f"{n_seated} of {n_seats} seats were taken within {_START_S:.0f} s") from None
                continue
            if answer and attempt is None:
                challenge = read_challenge(PIT, answer)
                request = JoinRequest(
                    rules_version=RULES_VERSION, name="bench", team="any", client=clients[slot // _SLOTS], slot=slot % _SLOTS
                )
                attempt = Attempt(identity, PIT, challenge, request)
                ask(slot, attempt.sealed, attempt)
                continue
            n_asked -= 1
            message = attempt.open(answer) if answer and attempt is not None else Wait(reason="")
            if isinstance(message, Ticket) and attempt is not None:
                n_seated += 1
                sealer, _ = attempt.sit(message.match, Team(message.team), message.secret)
                seal = partial(_seal_orders, sealer, actions)
                self.add(message.lane, Team(message.team), seal, partial(sealer.close, encode(Ready(known_ticks=0)), 0))
            elif isinstance(message, Wait):
                wanted.append(slot)
            else:
                raise ArenaError(f"the pit says no: {message}")
            self._take_all()

    def play(self, seconds: float) -> Measured:
        """Answer for so long; return what was seen meanwhile."""
        self._measured = Measured()
        before, begun_s = sum(pair.n_turns for pair in self._pairs.values()), time.monotonic()
        is_paced = self._pause_s[1] > 0
        while (now_s := time.monotonic()) < begun_s + seconds:
            if not self._take_all() and not self._answer_due(now_s):
                if is_paced:
                    time.sleep(_POLL_S)
                else:
                    self._take(self._heard.wait())
        self._measured.took_s = time.monotonic() - begun_s
        self._measured.n_turns = sum(pair.n_turns for pair in self._pairs.values()) - before
        return self._measured

    def get_ready(self) -> bool:
        """Say that seats are ready which were shown nothing yet; return whether there are none.

        It is said again and again: Zenoh drops what is put on a key before it knows who listens there.
        """
        silent = [seat for seat in self._seats.values() if seat.tick < 0]
        for seat in silent:
            seat.say_ready()
        return not silent

    def _take_all(self) -> bool:
        n = 0
        while n < 1_000 and (sample := self._heard.take()) is not None:
            self._take(sample)
            n += 1
        return n > 0

    def _take(self, sample: Sample) -> None:
        payload = read_payload(sample)
        seat = self._seats.get(read_key(sample))
        if seat is None or not payload:
            return
        now_s, tick = time.monotonic(), int.from_bytes(payload[8:12], "big")
        if tick <= seat.tick:
            return  # it comes again
        seat.tick = tick
        pair = self._pairs[seat.lane]
        if tick > pair.tick:
            if pair.n_answered == len(Team):
                self._measured.own_parts_s.append(now_s - pair.answered_at_s)
                pair.n_turns += 1
            pair.tick, pair.n_answered = tick, 0
        least_s, most_s = self._pause_s
        if most_s:
            if tick == 0:  # as in a pit where matches begin at any time
                least_s, most_s = most_s * pair.phase, most_s * pair.phase
            due_s = now_s + self._random.uniform(least_s, most_s)
            heapq.heappush(self._due, (due_s, next(self._numbers), seat, tick))
        else:
            self._answer(seat, tick)

    def _answer_due(self, now_s: float) -> bool:
        n = 0
        while self._due and self._due[0][0] <= now_s:
            due_s, _, seat, tick = heapq.heappop(self._due)
            self._measured.n_late += time.monotonic() - due_s > self._patience_s
            self._answer(seat, tick)
            n += 1
        return n > 0

    def _answer(self, seat: Seat, tick: int) -> None:
        seat.put(seat.seal(tick))
        pair = self._pairs[seat.lane]
        if pair.tick == tick:
            pair.n_answered += 1
            pair.answered_at_s = time.monotonic()


def _seal_orders(sealer: Sealer, actions: bytes, tick: int) -> bytes:
    return sealer.close(encode(Orders(tick=tick, actions=actions)), tick)
