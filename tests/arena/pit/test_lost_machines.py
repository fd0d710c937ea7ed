"""Machines that were lost: each is asked from time to time, and is used again once it could be."""

import errno
import os
import socket
from collections.abc import Callable, Sequence
from types import SimpleNamespace

import pytest

from arena.pit.workers import lost_machines
from arena.pit.workers.lost_machines import LostMachines
from arena.pit.workers.machines import HERE, Machine, ask
from arena.pit.workers.processes import is_right
from arena.pit.workers.worker import describe_version

ONE, OTHER = Machine("one"), Machine("other")


class AtOnce:
    """A thread that does all when it is started."""

    def __init__(self, *, target: Callable[..., None], args: Sequence[object], **_: object) -> None:
        self.start = lambda: target(*args)


class Asked:
    """What machines answer, in order, and nothing where nothing is left; and a clock."""

    def __init__(self) -> None:
        self.now_s = 100.0
        self.answers: dict[Machine, list[bytes]] = {ONE: [], OTHER: []}
        self.during: Callable[[], None] = lambda: None
        """What happens before the answer is there."""

    def ask(self, machine: Machine) -> bytes:
        self.during()
        return self.answers[machine].pop(0) if self.answers[machine] else b""


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> Asked:
    made = Asked()
    monkeypatch.setattr(lost_machines, "ask", made.ask)
    monkeypatch.setattr(lost_machines, "time", SimpleNamespace(monotonic=lambda: made.now_s))
    monkeypatch.setattr(lost_machines, "threading", SimpleNamespace(Thread=AtOnce))
    return made


def test_a_machine_that_was_lost_is_used_again_once_a_worker_there_says_the_right_thing(asked: Asked) -> None:
    judged = list[bytes]()
    machines = LostMachines([HERE, ONE, OTHER], lambda machine, said: judged.append(said) or said == b"right")
    assert machines.answering == [HERE, ONE, OTHER]
    machines.note_lost(ONE)
    machines.note_lost(OTHER)

    asked.answers[OTHER] = [b"", b"wrong", b"wrong", b"right"]
    for _ in range(3):
        asked.now_s += 20.0
        machines.ask()
        assert machines.answering == [HERE]
    asked.now_s += 20.0
    machines.ask()

    assert machines.answering == [HERE, OTHER]
    assert judged == [b"wrong", b"right"], "nobody is told the same twice"
    machines.note_answer(ONE)
    assert machines.answering == [HERE, ONE, OTHER]


def test_a_machine_that_does_not_answer_is_left_alone_for_a_while(asked: Asked) -> None:
    machines = LostMachines([ONE, OTHER], lambda machine, said: True)
    machines.note_lost(ONE)
    asked.now_s = 101.0
    machines.note_lost(OTHER)
    assert machines.longest_lost == ONE
    asked.answers[ONE] = [b"", b"there"]

    for asked.now_s, n_left in ((109.0, 2), (110.5, 1), (120.0, 1), (121.0, 0)):
        machines.ask()
        assert len(asked.answers[ONE]) == n_left

    assert machines.answering == [ONE]


def test_a_machine_that_is_lost_while_it_is_asked_is_lost(asked: Asked) -> None:
    machines = LostMachines([ONE], lambda machine, said: True)
    machines.note_lost(ONE)
    asked.now_s += 20.0
    asked.answers[ONE] = [b"there"]

    def lose() -> None:
        asked.now_s += 1.0
        machines.note_lost(ONE)

    asked.during = lose
    machines.ask()

    assert machines.answering == []


def test_a_worker_of_another_version_is_not_used_and_a_sentence_says_why(caplog: pytest.LogCaptureFixture) -> None:
    assert is_right(ONE, describe_version())
    assert not caplog.messages
    assert not is_right(ONE, b'{"arena": "0", "protocol": 1, "rules": 1}')
    (said,) = caplog.messages
    assert said.startswith("one has an arena of another version: arena 0 for ")


def test_a_machine_that_cannot_be_asked_for_want_of_files_is_asked_again(monkeypatch: pytest.MonkeyPatch) -> None:
    def socketpair() -> None:
        raise OSError(errno.EMFILE, os.strerror(errno.EMFILE))

    monkeypatch.setattr(socket, "socketpair", socketpair)

    assert ask(ONE) == b""
