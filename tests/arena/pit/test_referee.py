"""The shell of a pit, with a network of this test: effects are carried out in order, and none after one that fails."""

import resource
import time
from collections import defaultdict
from collections.abc import Callable, Iterable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from offline_pit import N_UNITS, PIT, RULES, plan

from arena.errors import ArenaError
from arena.game.types import RULES_VERSION, Team
from arena.match.time_control import TimeControl
from arena.pit import journal_files, referee
from arena.pit.match_session import PitContext
from arena.pit.referee import Referee
from arena.pit.seating import PlannedSeating
from arena.pit.workers.machines import HERE
from arena.protocol import topics
from arena.protocol.codec import decode, encode
from arena.protocol.handshake import Attempt
from arena.protocol.identity import Identity
from arena.protocol.messages import Challenge, ChallengeRequest, JoinRequest, Message, Orders, Ready, Ticket
from arena.protocol.sealing import Sealer
from arena.records.journal import read_journal


class Bytes(bytes):
    """A payload as Zenoh has it."""

    def to_bytes(self) -> bytes:  # type: ignore[override]
        return bytes(self)


class Question:
    def __init__(self, payload: bytes) -> None:
        self.payload, self.sender, self.answers = payload, "", list[bytes]()

    def answer(self, payload: bytes) -> None:
        self.answers.append(payload)


class Network:
    """A session whose samples are those that the test lays up."""

    def __init__(self) -> None:
        self.put: dict[str, list[bytes]] = defaultdict(list)
        self.samples: list[Any] = []
        self.ask: dict[str, Callable[[Any], None]] = {}

    def publisher(self, key: str) -> tuple[Callable[[bytes], None], Callable[[], None]]:
        return self.put[key].append, lambda: None

    def broadcast(self, key: str) -> Any:
        return SimpleNamespace(put=self.put[key].append, end=lambda: None, has_subscribers=False)

    def collect(self, key: str, most: int) -> Any:
        beat = SimpleNamespace(key_expr=topics.beat("pit"), payload=Bytes())
        return SimpleNamespace(
            wait=lambda: self.samples.pop(0) if self.samples else beat,
            take=lambda: self.samples.pop(0) if self.samples else None,
        )

    def answer(self, key: str, on_question: Callable[[Any], None]) -> None:
        self.ask[key] = on_question

    def watch_presence(self, key: str, on_change: Callable[[str, bool], None]) -> None:
        """Nobody comes or goes."""

    def relieve(self, find_kept: Callable[[], Any], now_s: float) -> int:
        return 0

    def heartbeat(self, key: str, period_s: float) -> Callable[[], None]:
        return lambda: None


class Pit:
    """A referee on that network, and a match of one entry against itself."""

    def __init__(self, folder: Path, n_ticks: int) -> None:
        rules = RULES.with_({"tick_limit": n_ticks})
        self.network, self.path = Network(), folder / "pit+0.journal"
        session: Any = self.network
        seating = PlannedSeating([plan("pit/0", "ann", "ann")])
        self.referee = Referee(
            session, PitContext(pit="pit", identity=PIT), rules, seating, TimeControl(), folder, on_end=lambda ended: None
        )
        self.sealers: dict[Team, Sealer] = {}

    def ask_for_seats(self) -> list[tuple[Attempt, Question]]:
        """Ask for both seats."""
        ann, asked = Identity.make(), list[tuple[Attempt, Question]]()
        for slot in range(2):
            challenge = decode(self.ask(encode(ChallengeRequest())).answers[0])
            assert isinstance(challenge, Challenge)
            request = JoinRequest(rules_version=RULES_VERSION, name="ann", team="any", client="c", slot=slot)
            attempt = Attempt(ann, "pit", challenge, request)
            asked.append((attempt, self.ask(attempt.sealed)))
        return asked

    def sit(self) -> "Pit":
        """Take both seats."""
        for attempt, question in self.ask_for_seats():
            ticket = attempt.open(question.answers[0])
            assert isinstance(ticket, Ticket)
            self.lane, team = ticket.lane, Team(ticket.team)
            self.sealers[team], _ = attempt.sit(ticket.match, team, ticket.secret)
        self.send(Ready(known_ticks=0))
        return self

    def run(self) -> None:
        passes = iter((False, True))
        self.referee.run(lambda: next(passes))

    def ask(self, payload: bytes) -> Question:
        question = Question(payload)
        self.network.ask[topics.join("pit")](question)
        self.run()
        return question

    def put(self, message: Message) -> None:
        """Have both seats say something, which the referee has not taken up yet."""
        for team, sealer in self.sealers.items():
            key = topics.action("pit", self.lane, team)
            self.network.samples.append(SimpleNamespace(key_expr=key, payload=Bytes(sealer.close(encode(message), 0))))

    def send(self, message: Message) -> None:
        self.put(message)
        self.run()

    @property
    def n_sent(self) -> list[int]:
        return [len(self.network.put[topics.observation("pit", self.lane, team)]) for team in Team]

    @property
    def n_written(self) -> int:
        return len(read_journal(self.path.read_bytes()).ticks) if self.path.exists() else 0


def test_orders_that_come_are_written_and_the_next_turn_is_sent(tmp_path: Path) -> None:
    pit = Pit(tmp_path, n_ticks=2).sit()
    assert (pit.n_written, pit.n_sent) == (0, [1, 1])

    pit.send(Orders(tick=0, actions=bytes(N_UNITS)))

    assert (pit.n_written, pit.n_sent) == (1, [2, 2])
    pit.referee.close()


def set_clock(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """Give the referee a clock that goes on by a millisecond whenever it is read, and by what is added to it."""
    now_s = [time.monotonic()]

    def read() -> float:
        now_s[0] += 0.001
        return now_s[0]

    monkeypatch.setattr("arena.pit.match_loop.time", SimpleNamespace(monotonic=read))
    return now_s


def test_time_that_the_pit_spends_elsewhere_is_charged_to_no_seat(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pit = Pit(tmp_path, n_ticks=2).sit()
    now_s = set_clock(monkeypatch)
    pit.run()  # the queue is seen empty, and each seat was asked
    [match] = pit.referee.matches

    def hold_up(answer: bytes) -> None:
        """Have the thread answer somebody for half an hour, while the seats' orders come."""
        now_s[0] += 1_800.0
        pit.put(Orders(tick=0, actions=bytes(N_UNITS)))

    question: Any = SimpleNamespace(payload=b"", key="", answer=hold_up)
    pit.network.ask[topics.lobby("pit")](question)
    pit.run()

    assert pit.n_written == 1
    assert [match.record(team).late for team in Team] == [0, 0]
    assert max(match.record(team).latencies_s[0] for team in Team) < 60.0
    pit.referee.close()


def test_a_queue_that_is_never_empty_gives_nobody_time_for_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pit = Pit(tmp_path, n_ticks=2).sit()
    now_s = set_clock(monkeypatch)
    pit.run()  # the queue is seen empty, and each seat was asked
    [match] = pit.referee.matches
    junk = SimpleNamespace(key_expr="junk", payload=Bytes(b""))

    pit.network.samples += [junk] * 2_000
    now_s[0] += 5.0  # in which both seats think
    pit.run()
    pit.put(Orders(tick=0, actions=bytes(N_UNITS)))
    for _ in range(20):
        pit.run()

    assert pit.n_written == 1
    assert [match.record(team).latencies_s[0] >= 5.0 for team in Team] == [True, True]
    pit.referee.close()


@pytest.mark.parametrize("n_ticks", [1, 2])
def test_a_tick_that_cannot_be_written_ends_the_pit_and_nothing_of_it_is_sent_or_signed(
    n_ticks: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pit = Pit(tmp_path, n_ticks).sit()

    def fail(*_: object) -> int:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.write", fail)
    with pytest.raises(ArenaError, match=r"^cannot write a journal: No space left on device$"):
        pit.send(Orders(tick=0, actions=bytes(N_UNITS)))
    monkeypatch.undo()
    pit.referee.close()

    assert (pit.n_written, pit.n_sent) == (0, [1, 1])


def test_a_pit_without_a_file_to_spare_begins_no_match_and_stays_open(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    monkeypatch.setattr(journal_files, "MOST_SPARE", 0)  # as if others had taken all before it opened
    pit = Pit(tmp_path, n_ticks=1)
    monkeypatch.undo()
    resource.setrlimit(resource.RLIMIT_NOFILE, (0, hard))
    try:
        asked = pit.ask_for_seats()
        assert [question.answers for _, question in asked] == [[], []]
        assert pit.referee.n_running == 0
    finally:
        resource.setrlimit(resource.RLIMIT_NOFILE, (soft, hard))

    assert pit.sit().n_sent == [1, 1]
    pit.referee.close()


def test_a_pit_leaves_no_file_of_a_match_that_never_began(tmp_path: Path) -> None:
    pit = Pit(tmp_path, n_ticks=1).sit()
    assert not list(tmp_path.glob("*.journal"))

    pit.referee.close()

    assert not list(tmp_path.iterdir())


def test_a_pit_whose_workers_cannot_be_started_leaves_no_heartbeat(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    beating = set[str]()

    class Beating(Network):
        def heartbeat(self, key: str, period_s: float) -> Callable[[], None]:
            beating.add(key)
            return lambda: beating.discard(key)

        def beat(self, keys: Iterable[str], period_s: float) -> Callable[[], None]:
            return self.heartbeat(" ".join(keys), period_s)

    class Stillborn:
        def __init__(self, *_: object, **__: object) -> None:
            """Have workers."""

        def start(self) -> None:
            assert len(beating) == 2
            raise ArenaError("worker 1 died")

        def close(self) -> None:
            """Nothing runs."""

    monkeypatch.setattr(referee, "WorkerProcesses", Stillborn)
    session: Any = Beating()
    context = PitContext(pit="pit", identity=PIT)

    with pytest.raises(ArenaError, match="worker 1 died"):
        Referee(session, context, RULES, PlannedSeating(), TimeControl(), tmp_path, workers=[HERE], on_end=lambda ended: None)

    assert not beating
