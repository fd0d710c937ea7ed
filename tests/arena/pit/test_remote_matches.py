"""The pit's side of its workers, without them: what they are handed, what becomes of it when they die, what they leave behind."""

import json
import pickle
import time
from ctypes import c_longlong
from multiprocessing.connection import Connection
from pathlib import Path
from queue import SimpleQueue
from typing import Any

import pytest
from offline_pit import PIT, RULES, OfflinePit, Player, begin, plan, play

from arena.errors import ArenaError
from arena.game.types import Team, Termination
from arena.match.time_control import TimeControl
from arena.pit.authenticator import PendingRequest
from arena.pit.core import PitCore
from arena.pit.effects import Drop, Effect, TellPit, TellWorker
from arena.pit.events import ActionReceived, Event, Ordered, TimePassed, UnfinishedFound, WorkerLost, WorkerReady, WorkerSaid
from arena.pit.match_session import PitContext
from arena.pit.match_sessions import MatchClosed, MatchOver, NewMatch
from arena.pit.seats import Seat
from arena.pit.workers.left_matches import find_left
from arena.pit.workers.messages import GiveSeat, Gone, Over, Room, Shut, TakeMatch, VoidMatch, WorkerSettings
from arena.pit.workers.processes import WorkerProcesses
from arena.pit.workers.remote_sessions import MOST_DEATHS, RemoteSessions
from arena.pit.workers.worker import describe_version
from arena.pit.workers.worker_core import WorkerCore
from arena.protocol.identity import Identity
from arena.protocol.messages import Done, Ended, Refusal, Signed, Turn
from arena.protocol.topics import lanes_of_worker
from arena.records.journal import Header, journal_name, read_journal
from arena.records.plan import network_name
from arena.records.replay import verify

CONTEXT = PitContext(pit="pit", identity=PIT)
NONCE = bytes(16)


class Pit:
    """A pit's side of two workers, both ready."""

    def __init__(self) -> None:
        self.over: list[MatchOver] = []
        self.closed: list[MatchClosed] = []
        self.sessions = RemoteSessions(2, CONTEXT, self._note(self.over), self._note(self.closed))
        self.now_s = 100.0
        for worker in (1, 2):
            self.hear(WorkerReady(worker))
            self.hear(WorkerSaid(worker, Room(0, 8)))

    def _note(self, noted: list[Any]) -> Any:
        return lambda item: noted.append(item) or []

    def hear(self, event: WorkerReady | WorkerLost | WorkerSaid) -> list[Effect]:
        return self.sessions.hear(event, self.now_s)

    def begin(self, number: int) -> tuple[str, int]:
        """Begin a match; return its name, and whose it is."""
        new = new_match(f"pit/{number}", self.sessions.take_lane(self.now_s))
        [told] = self.sessions.begin(new, self.now_s)
        assert isinstance(told, TellWorker)
        assert isinstance(told.order, TakeMatch)
        return told.order.match, told.worker


def new_match(identity: str, lane: int = 100_000) -> NewMatch:
    planned = plan(identity, "ann", "bob")
    header = Header(identity=identity, blue="ann", red="bob", ruleset=RULES, keys=planned.keys)
    return NewMatch(header=header, entries={team: bytes(32) for team in Team}, nonce=NONCE, lane=lane)


def handed(effects: list[Effect]) -> dict[str, TakeMatch]:
    """Return the matches that workers were handed."""
    orders = [effect.order for effect in effects if isinstance(effect, TellWorker)]
    return {order.match: order for order in orders if isinstance(order, TakeMatch)}


def test_matches_go_to_the_worker_that_has_the_least_to_do_and_come_back_to_their_lane() -> None:
    pit = Pit()
    begun = [pit.begin(number) for number in range(4)]

    assert sorted(worker for _, worker in begun) == [1, 1, 2, 2]
    assert pit.sessions.n_free == 12
    pit.hear(WorkerLost(1))
    assert pit.sessions.n_free == 6
    taken_up = handed(pit.hear(WorkerReady(1)))

    assert {match for match, worker in begun if worker == 1} == taken_up.keys()
    assert all(order.is_resumed and not order.given_up for order in taken_up.values())
    lanes = {one.id: one.new.lane for one in pit.sessions.running}
    assert all(order.new.lane == lanes[match] for match, order in taken_up.items())


def test_a_match_that_kills_its_worker_again_and_again_is_given_up_and_no_other() -> None:
    pit = Pit()
    guilty, worker = pit.begin(0)
    others = [pit.begin(number) for number in range(1, 3)]
    innocent = next(match for match, its in others if its == worker)
    [lane] = [one.new.lane for one in pit.sessions.running if one.id == guilty]

    for _ in range(MOST_DEATHS):
        pit.hear(WorkerLost(worker, lane))
        assert not handed(pit.hear(WorkerReady(worker)))[guilty].given_up
    pit.hear(WorkerLost(worker, lane))
    taken_up = handed(pit.hear(WorkerReady(worker)))

    assert taken_up[guilty].given_up == f"its worker died {MOST_DEATHS + 1} times in a row"
    assert not taken_up[innocent].given_up


def test_who_asks_a_worker_that_dies_is_left_to_ask_again_and_an_operators_word_outlives_it() -> None:
    pit = Pit()
    match, worker = pit.begin(0)
    pending: Any = PendingRequest(caller=None, question=5)  # type: ignore[arg-type]  # the pit hands it on as it is
    [told] = pit.sessions.issue_ticket(Seat(match, Team.RED), pending, pit.now_s)
    assert isinstance(told, TellWorker)
    assert isinstance(told.order, GiveSeat)
    assert pit.sessions.void(match, "was ended by the operator", pit.now_s)

    assert pit.hear(WorkerLost(worker)) == [Drop(5)]
    assert pit.sessions.issue_ticket(Seat(match, Team.RED), PendingRequest(pending.caller, 6), pit.now_s) == []
    pit.now_s += 10.0
    assert pit.sessions.advance(pit.now_s) == [Drop(6)]
    assert TellWorker(worker, VoidMatch(match, "was ended by the operator")) in pit.hear(WorkerReady(worker))


def test_a_match_that_no_worker_can_take_up_is_void() -> None:
    pit = Pit()
    match, worker = pit.begin(0)

    pit.hear(WorkerSaid(worker, Gone(match, "its journal does not hold")))

    [over] = pit.over
    assert (over.ended.result.ending, over.ended.result.reason) == (Termination.VOID, "its journal does not hold")
    assert [(closed.match, closed.header) for closed in pit.closed] == [(match, None)]
    assert not pit.sessions.running


@pytest.fixture
def left(tmp_path: Path) -> tuple[Path, TakeMatch]:
    """Return the journal of a match in its middle, as a process that died has left it."""
    pit = OfflinePit()
    play(*begin(pit), n_ticks=2)
    [(name, data)] = pit.journals.items()
    path = tmp_path / name
    path.write_bytes(data + b"T")  # it died while it wrote
    journal = read_journal(data)
    assert journal.seals is not None
    new = NewMatch(header=journal.header, entries=journal.seals.entries, nonce=journal.seals.nonce, lane=100_000)
    return path, TakeMatch(match=journal.name, new=new, is_resumed=True)


def find(order: TakeMatch, path: Path) -> Any:
    return find_left(order, path.parent, PIT, fsync=False)


def test_what_a_worker_left_is_taken_up_or_ended_or_begun_again(left: tuple[Path, TakeMatch]) -> None:
    path, order = left
    found = find(order, path)
    assert isinstance(found, UnfinishedFound)
    assert (len(found.journal.ticks), found.n_bytes) == (2, len(path.read_bytes()) - 1)

    given_up = TakeMatch(match=order.match, new=order.new, is_resumed=True, given_up="its worker died")
    over, shut = find(given_up, path)
    assert isinstance(over, Over)
    assert (over.result.ending, over.result.reason, over.result.ticks) == (Termination.VOID, "its worker died", 2)
    assert shut == Shut(order.match, has_journal=True)
    journal = read_journal(path.read_bytes())
    assert verify(journal) == 2
    assert journal.seals is not None
    assert journal.seals.signature

    path.write_bytes(path.read_bytes()[:-65])  # it died before it signed
    again, _ = find(order, path)
    assert again.result == over.result
    assert read_journal(path.read_bytes()) == journal

    path.unlink()
    assert find(order, path) is None
    assert find(given_up, path) == [Gone(order.match, "its worker died")]


def test_a_journal_of_another_match_is_not_touched(left: tuple[Path, TakeMatch]) -> None:
    path, order = left
    before = path.read_bytes()
    other = network_name(order.new.header.identity, PIT.public, bytes(16))

    [gone] = find(TakeMatch(match=other, new=order.new, is_resumed=True), path)

    assert gone == Gone(other, f"{journal_name(order.new.header.identity)} is another match's")
    assert path.read_bytes() == before


def work_of_another_version(pipe: Connection, mark: c_longlong) -> None:
    """Say what another version would, and wait for an answer."""
    said = json.loads(describe_version())
    pipe.send_bytes(json.dumps({**said, "protocol": 99}).encode())
    pipe.recv()


def test_a_worker_of_another_version_is_refused_with_a_sentence(tmp_path: Path) -> None:
    settings = WorkerSettings(
        number=3, endpoint="", pit="pit", private=Identity.make().private.private_bytes_raw(), spectator_key=None,
        public_delay=0, ruleset=RULES, time_control=TimeControl(), journals=tmp_path, fsync=False,
    )  # fmt: skip
    heard: SimpleQueue[Any] = SimpleQueue()
    workers = WorkerProcesses([settings], heard.put, target=work_of_another_version)
    workers.start()
    try:
        with pytest.raises(
            ArenaError,
            match=r"^worker 3 is a worker of another version: protocol 99 for \d+; the arena was installed anew",
        ):
            heard.get(timeout=60.0)()
    finally:
        workers.close()
    end_s = time.monotonic() + 60.0
    while not workers.has_ended:
        assert time.monotonic() < end_s
        time.sleep(0.01)


class PitWithWorkers(OfflinePit):
    """A core and its two workers, all of them in this process."""

    def __init__(self, **options: Any) -> None:
        super().__init__(**options)
        self.core = PitCore(CONTEXT, RULES, self.seating, TimeControl(), self.register, n_workers=2)
        self.workers = {number: WorkerCore(CONTEXT, RULES, TimeControl(), lanes_of_worker(number)) for number in (1, 2)}
        for number in self.workers:
            self.do(WorkerReady(number))
            self.do(WorkerSaid(number, Room(0, 8)))

    def do(self, event: Event) -> list[Effect]:
        if isinstance(event, ActionReceived):
            its = (event.lane - 100_000) // 10_000 + 1
            self._carry_all(self.workers[its].receive(event, self.now_s), its)
            return []
        effects = self.core.receive(event, self.now_s)
        self._carry_all(effects)
        if isinstance(event, TimePassed):
            for number, worker in self.workers.items():
                self._carry_all(worker.receive(event, self.now_s), number)
        return effects

    def _carry_all(self, effects: list[Effect], worker: int = 0) -> None:
        for effect in effects:
            if isinstance(effect, TellWorker):
                self._carry_all(self.workers[effect.worker].receive(Ordered(effect.order), self.now_s), effect.worker)
            elif isinstance(effect, TellPit):
                self.do(WorkerSaid(worker, pickle.loads(pickle.dumps(effect.report))))
            else:
                self._carry_out(effect)


def test_a_match_in_a_worker_is_played_counted_and_archived_as_in_a_pit_without() -> None:
    pit = PitWithWorkers()
    pairs = [begin(pit), begin(pit, "eve", "dan")]
    assert [worker.n_running for worker in pit.workers.values()] == [1, 1]
    (ann, bob), (eve, _) = pairs

    ends = play(ann, bob)
    assert [end.ending for end in ends if isinstance(end, Ended)] == ["tick_limit"] * 2
    assert isinstance(pit.reply(pit.ask_for_journal(eve.ticket.match)), Refusal)
    question = pit.ask_for_journal(ann.ticket.match)
    assert pit.reply(question) is None
    for player in (ann, bob):
        player.give_receipt()
    pit.pass_time()

    [ended] = pit.ended
    assert (ended.result.ending, ended.header.blue) == (Termination.TICK_LIMIT, "ann")
    assert pit.register.find("ann") == ann.identity.public
    journal = read_journal(pit.replies[question] or b"")
    assert verify(journal) == RULES.tick_limit
    assert journal.seals is not None
    assert len(journal.seals.receipts) == 2
    assert isinstance(ann.ask(match=ann.ticket.match), Signed)
    assert [one["match"] for one in pit.lobby().running] == [eve.ticket.match]


def test_an_operator_reaches_a_match_in_a_worker_and_so_does_a_client_that_comes_back() -> None:
    pit = PitWithWorkers()
    ann, bob = begin(pit)
    play(ann, bob, n_ticks=2)
    operator = Player(pit, "operator", PIT)

    ann.vanish()
    ann.join(match=ann.ticket.match).ready()
    assert any(isinstance(message, Turn) for message in ann.read())
    assert isinstance(operator.command("abort", ann.ticket.match), Done)
    assert [message.ending for message in bob.read() if isinstance(message, Ended)] == ["void"]
    assert isinstance(operator.command("abort", ann.ticket.match), Refusal)
    [ended] = pit.ended
    assert ended.seats[ann.team].vanished == 1
