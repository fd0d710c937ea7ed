"""A worker on another machine, without the machine: nothing leaves it before the pit has the journal that it follows from."""

from multiprocessing import Pipe
from pathlib import Path
from typing import Any

import pytest
from offline_pit import PIT, RULES

from arena.errors import ArenaError, InputError
from arena.game.types import Team
from arena.match.time_control import TimeControl
from arena.pit.effects import Append, CloseMatch, OpenMatch, PublishTick, Send, TellPit
from arena.pit.workers.far_worker import FarLoop
from arena.pit.workers.journal_copies import JournalCopies
from arena.pit.workers.machines import HERE, Machine, parse_machine
from arena.pit.workers.messages import Piece, Shut, Stand, WorkerSettings, Written


class Broadcast:
    has_subscribers = True

    def __init__(self, key: str, sent: list[Any]) -> None:
        self.put, self.end = (lambda payload: sent.append((key, payload))), (lambda: None)


class Wires:
    """A Zenoh session, as far as a worker's loop uses one: what is published is noted."""

    def __init__(self) -> None:
        self.sent: list[Any] = []

    def publisher(self, key: str) -> Any:
        return (lambda payload: self.sent.append((key, payload))), (lambda: None)

    def broadcast(self, key: str) -> Broadcast:
        return Broadcast(key, self.sent)

    def collect(self, key: str, most: int) -> None:
        """Hear nothing."""

    def waker(self, key: str) -> Any:
        return (lambda payload: None), (lambda: None)


def make_loop(folder: Path) -> tuple[Any, Wires, Any]:
    settings = WorkerSettings(
        number=1, endpoint="", pit="pit", private=PIT.private.private_bytes_raw(), spectator_key=None, public_delay=0,
        ruleset=RULES, time_control=TimeControl(), journals=folder, fsync=False,
    )  # fmt: skip
    wires, (ours, theirs) = Wires(), Pipe()
    loop: Any = FarLoop(wires, settings, theirs)  # type: ignore[arg-type]  # `Wires` and a pipe stand for what they are like
    return loop, wires, ours


def test_nothing_leaves_before_the_journal_stands_and_then_all_does_in_its_order(tmp_path: Path) -> None:
    loop, wires, _ = make_loop(tmp_path)
    board = [b"as it was"]
    effects = [
        OpenMatch("match", "j.journal", 0, 100_000),
        Send("match", Team.BLUE, b"before"),
        Append("match", b"start"),
        Send("match", Team.BLUE, b"turn"),
        PublishTick("match", lambda: board[0], None),
        Append("match", b"tick"),
        Send("match", Team.RED, b"next"),
        TellPit(Shut("match", has_journal=True)),
        CloseMatch("match"),
    ]
    loop._perform(effects)
    board[0] = b"as it is"
    assert [payload for _, payload in wires.sent] == [b"before"]

    loop._hear(Stand(1))
    loop._release()
    assert [payload for _, payload in wires.sent] == [b"before", b"turn", b"as it was"]
    reports = [loop._reports.get() for _ in range(loop._reports.qsize())]
    assert reports == [
        Written((Piece("match", "j.journal", 0, b"start"),)),
        Written((Piece("match", "j.journal", 5, b"tick"),)),
    ]

    loop._hear(Stand(2))
    loop._release()
    assert [payload for _, payload in wires.sent][3:] == [b"next"]
    assert loop._reports.get() == Shut("match", has_journal=True)
    assert not loop._channels


def test_pieces_that_wait_go_in_one_message_and_what_follows_them_after_it(tmp_path: Path) -> None:
    loop, _, pit = make_loop(tmp_path)
    pieces = [Piece("match", "j.journal", n, b"x") for n in range(3)]
    for piece in pieces[1:]:
        loop._reports.put(Written((piece,)))
    loop._reports.put(Shut("match", has_journal=True))

    loop._send(Written((pieces[0],)))
    assert pit.recv() == Written(tuple(pieces))
    assert pit.recv() == Shut("match", has_journal=True)


def test_the_pit_writes_what_it_is_sent_where_it_belongs(tmp_path: Path) -> None:
    (tmp_path / "new.journal").write_bytes(b"of an earlier match")
    (tmp_path / "old.journal").write_bytes(b"whole, torn")
    copies = JournalCopies(tmp_path, fsync=False)

    pieces = [("new", 0, b"be"), ("old", 5, b" and more"), ("new", 2, b"gun")]
    written = Written(tuple(Piece(match, f"{match}.journal", n_before, data) for match, n_before, data in pieces))
    assert copies.write(written) == Stand(3)
    assert copies.write(Written(())) == Stand(3)

    copies.shut("new")
    copies.close()
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == {
        "new.journal": b"begun", "new.journal.1": b"of an earlier match", "old.journal": b"whole and more",
    }  # fmt: skip


def test_what_cannot_be_written_is_told_and_does_not_stand(tmp_path: Path) -> None:
    (tmp_path / "match.journal").mkdir()
    with pytest.raises(ArenaError, match="cannot write a journal"):
        JournalCopies(tmp_path, fsync=False).write(Written((Piece("match", "match.journal", 5, b"x"),)))


def test_machines_are_named_as_ssh_takes_them() -> None:
    assert parse_machine("ann@10.0.0.2=2", "arena") == [Machine("ann@10.0.0.2")] * 2
    assert parse_machine("far", "/opt/arena") == [Machine("far", "/opt/arena")]
    assert str(HERE) == "this machine"
    for wrong in ("", "=2", "far=", "far=0", "far=x", "far=65", "-oProxyCommand=2", "a b=2"):
        with pytest.raises(InputError, match="HOST=N"):
            parse_machine(wrong, "arena")
