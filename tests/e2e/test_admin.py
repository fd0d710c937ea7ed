"""The operator's word to a running pit, and nobody else's."""

import re
import signal
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path
from queue import SimpleQueue
from typing import Any

import pytest

from arena.game.types import Termination
from arena.keyring.files import load, make
from arena.keyring.ring import entry_key_path
from arena.network.session import Session, open_client
from arena.protocol import topics
from arena.protocol.codec import decode, encode
from arena.protocol.handshake import Attempt
from arena.protocol.identity import Identity
from arena.protocol.messages import AdminRequest, Challenge, ChallengeRequest, Done, Lobby, Refusal, Signed
from arena.protocol.signed import STATEMENT_VERSION
from arena.records.journal_folder import load_journal
from arena.records.replay import verify

Start = Callable[..., Any]
PATIENCE_S = 60.0
COMMANDS = ("kick", "ban", "close", "abort", "release-name")
BOT = """
import threading
from pathlib import Path

def act(observation):
    if observation.tick == 1:
        print("thinking", flush=True)
        while not Path({go!r}).exists():
            threading.Event().wait(0.05)
    return [0] * len(observation.units)
"""


@pytest.fixture
def admin(start: Start, port: int, tmp_path: Path) -> Start:
    """Tell the pit something, and return the exit code and what is said."""

    def tell(*arguments: object, data: Path = tmp_path) -> tuple[int, str]:
        process = start("admin", *arguments, "--pit", f"arena://127.0.0.1:{port}/pit", "--data", data)
        return process.finish(), process.said.strip()

    return tell


@pytest.fixture
def match(join: Start, tmp_path: Path) -> Callable[[], tuple[Any, Any, str]]:
    """Begin a match of red's held and blue's other, who think at tick 1 until there is a file `go`; return its name too."""

    def begin() -> tuple[Any, Any, str]:
        bot = tmp_path / "held.py"
        bot.write_text(BOT.format(go=str(tmp_path / "go")))
        red, blue = join("--team", "red", "--policy", bot), join("--team", "blue", "--policy", bot, "--name", "other")
        for player in (red, blue):
            player.wait_for("thinking")
        return red, blue, red.said.partition("match ")[2].partition(":")[0]

    return begin


@pytest.fixture
def session(port: int) -> Iterator[Callable[[], Session]]:
    """Connect to the pit, and to nothing but it."""
    with ExitStack() as sessions:
        yield lambda: sessions.enter_context(open_client(f"tcp/127.0.0.1:{port}"))


@pytest.fixture
def await_guests(session: Start) -> Callable[..., None]:
    """Wait until those who wait for an opponent are these."""

    def wait(*names: str) -> None:
        one = session()
        end_s = time.monotonic() + PATIENCE_S
        while (waiting := lobby(one).waiting) != list(names):
            assert time.monotonic() < end_s, waiting

    return wait


def ask(session: Session, key: str, payload: bytes) -> bytes:
    """Return the answer to one question."""
    answers: SimpleQueue[bytes] = SimpleQueue()
    session.ask(key, payload, answers.put, PATIENCE_S)
    return answers.get(timeout=PATIENCE_S)


def lobby(session: Session) -> Lobby:
    signed = decode(ask(session, topics.lobby("pit"), b""))
    assert isinstance(signed, Signed)
    said = decode(signed.data, STATEMENT_VERSION)
    assert isinstance(said, Lobby)
    return said


def attempt(session: Session, identity: Any, command: str, target: str) -> Attempt:
    challenge = decode(ask(session, topics.join("pit"), encode(ChallengeRequest())))
    assert isinstance(challenge, Challenge)
    return Attempt(identity, "pit", challenge, AdminRequest(command=command, target=target))


def test_who_is_kicked_forfeits_or_stops_waiting_and_may_come_back(
    serve: Start, join: Start, admin: Start, match: Start, await_guests: Start, tmp_path: Path
) -> None:
    pit = serve("--turn-time", 60)
    red, blue, _ = match()
    guest = join("--name", "guest")
    await_guests("guest")

    assert admin("kick", "held") == (0, "held: 1 seats forfeited, 0 sent away")
    assert admin("kick", "guest") == (0, "guest: 0 seats forfeited, 1 sent away")
    assert admin("kick", "nobody") == (1, "arena: the pit says no: nobody is not here")

    (tmp_path / "go").touch()
    assert [process.finish() for process in (red, blue, guest)] == [0, 0, 1], blue.said
    assert "loss as red by forfeit (red was removed by the operator) after 1 ticks" in red.said
    assert "win as blue by forfeit (red was removed by the operator) after 1 ticks" in blue.said
    assert "arena: the pit says no: the operator sent this client away" in guest.said
    assert "blue wins by forfeit (red was removed by the operator)" in pit.said
    again = [join("--name", name) for name in ("guest", "held")]
    assert [process.finish() for process in again] == [0, 0]


def test_who_is_banned_forfeits_and_is_not_let_in_again_by_any_name_nor_after_a_restart(
    serve: Start, join: Start, admin: Start, match: Start, await_guests: Start, tmp_path: Path
) -> None:
    pit = serve("--turn-time", 60)
    red, blue, _ = match()
    sentence = "arena: the pit says no: this key is banned from the pit"

    assert admin("ban", "held") == (0, "held is banned; held: 1 seats forfeited, 0 sent away")
    assert admin("ban", "nobody") == (1, "arena: the pit says no: nobody is not here")
    key = Identity.make().fingerprint
    assert admin("ban", key) == (0, f"{key} is banned; it was not here")
    (tmp_path / "go").touch()
    assert [process.finish() for process in (red, blue)] == [0, 0]
    assert "forfeit (red was removed by the operator)" in pit.said

    def knock() -> None:
        again = join("--name", "held"), join("--name", "other", "--key", entry_key_path("held"))
        for process in again:
            assert process.finish() == 1
            assert process.said.splitlines()[-1] == sentence

    knock()
    pit.kill()
    serve("--turn-time", 60)
    knock()
    join("--policy", "rush")
    await_guests("rush")


def test_a_closed_pit_ends_after_the_match_that_runs(
    serve: Start, join: Start, admin: Start, match: Start, await_guests: Start, tmp_path: Path
) -> None:
    pit = serve("--turn-time", 60)
    red, blue, _ = match()
    guest = join("--name", "guest")
    await_guests("guest")

    assert admin("close") == (0, "the pit begins no more matches")
    guest.wait_for("no more: the pit begins no more matches")
    assert pit.process.poll() is None
    (tmp_path / "go").touch()

    assert [process.finish() for process in (red, blue, guest, pit)] == [0, 0, 0, 0]
    (path,) = (tmp_path / "journals").glob("*.journal")
    journal = load_journal(path)
    assert verify(journal) > 1
    assert journal.ending is not None
    assert journal.ending.ending is not Termination.VOID


def test_an_aborted_match_is_void_and_gives_nobody_a_name(serve: Start, admin: Start, match: Start, tmp_path: Path) -> None:
    pit = serve("--turn-time", 60)
    red, blue, name = match()

    assert admin("abort", "another") == (1, "arena: the pit says no: another is not here")
    assert admin("abort", name) == (0, f"match {name} is void")
    assert admin("release-name", "held") == (1, "arena: the pit says no: held is not here")
    (tmp_path / "go").touch()

    assert [process.finish() for process in (red, blue)] == [0, 0]
    pit.send(signal.SIGTERM)
    assert pit.finish() == 0
    for process in (red, blue, pit):
        assert re.search(r"void( as \w+)? \(was ended by the operator\) after 1 ticks, score \+0", process.said)
    (path,) = (tmp_path / "journals").glob("*.journal")
    journal = load_journal(path)
    assert verify(journal) == 1
    assert journal.ending is not None
    assert journal.ending.ending is Termination.VOID


def test_only_who_has_the_pits_key_is_obeyed_and_once(
    serve: Start, join: Start, admin: Start, session: Start, await_guests: Start, tmp_path: Path
) -> None:
    pit = serve()
    true = load(tmp_path / "keys" / "pit.key")
    other = make(tmp_path / "other" / "keys" / "pit.key")
    guest = join("--name", "guest")
    await_guests("guest")

    assert admin("kick", "guest", data=tmp_path / "other") == (
        2,
        f"arena: the pit's key is {true.fingerprint}, and this is {other.fingerprint}; name the --data of that pit",
    )
    exit_code, said = admin("kick", "guest", data=tmp_path / "none")
    assert exit_code == 2
    assert "arena: there is no key file " in said

    class Liar:
        """Names the pit's key, and signs with its own."""

        public, sign = true.public, other.sign

    one = session()
    for command in COMMANDS:
        own = attempt(one, other, command, "guest")
        answer = own.open(ask(one, topics.join("pit"), own.sealed))
        assert answer == Refusal(reason="only the holder of the pit's key is obeyed")
        lie = decode(ask(one, topics.join("pit"), attempt(one, Liar(), command, "guest").sealed))
        assert lie == Refusal(reason="the signature of a request does not hold")
    unknown = attempt(one, true, "open", "guest")
    answer = unknown.open(ask(one, topics.join("pit"), unknown.sealed))
    assert answer == Refusal(reason=f"there is no command 'open'; it is one of {', '.join(COMMANDS)}")
    assert lobby(one).waiting == ["guest"]
    assert not (tmp_path / "register.json").exists()

    once = attempt(one, true, "kick", "guest")
    assert once.open(ask(one, topics.join("pit"), once.sealed)) == Done(text="guest: 0 seats forfeited, 1 sent away")
    assert guest.finish() == 1
    await_guests()
    guest = join("--name", "guest")
    await_guests("guest")
    assert decode(ask(one, topics.join("pit"), once.sealed)) == Refusal(reason="a request comes a second time")
    enemy = join("--name", "enemy")

    assert [process.finish() for process in (guest, enemy)] == [0, 0]
    assert pit.process.poll() is None
    assert "Traceback" not in pit.said
