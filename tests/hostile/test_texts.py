"""A pit whose every text is made for the terminal of whoever reads it: none may reach it raw."""

import subprocess
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import pytest
from cryptography.hazmat.primitives.asymmetric.x25519 import X25519PrivateKey
from cryptography.hazmat.primitives.serialization import Encoding, NoEncryption, PrivateFormat

from arena.game.keys import MatchKeys
from arena.game.ruleset import load, to_dict
from arena.game.types import Team, Termination
from arena.network.session import Query, Session, open_router
from arena.pit.ladder import LadderMatch
from arena.policy import MatchResult
from arena.protocol import topics
from arena.protocol.codec import decode, encode
from arena.protocol.handshake import Caller, new_secret, open_request, sign_challenge
from arena.protocol.identity import Identity
from arena.protocol.messages import (
    AdminRequest,
    Challenge,
    ChallengeRequest,
    Commitment,
    Done,
    Ended,
    Lobby,
    Message,
    Refusal,
    Ticket,
    Wait,
)
from arena.protocol.signed import commit, sign_statement
from tournaments.ladder.ladder_store import LadderStore
from tournaments.ladder.skill import LadderEntry

Run = Callable[..., subprocess.CompletedProcess[str]]
TRAP = "a\x1b]0;owned\x07\x1b[2J\r\u202egood\x9b31m\n3 of 3 journals hold"
"""Sets the title, clears the screen, writes over the line, turns it round, and adds a line of its own."""
SHOWN = r"a\x1b]0;owned\x07\x1b[2J\r\u202egood\x9b31m\n3 of 3 journals hold"
MATCH = "0123456789abcdef"
KEYS = MatchKeys(map_key=bytes(32), match_key=bytes(32))


class HostilePit:
    """A router that speaks the protocol, and says what it likes."""

    def __init__(self, session: Session) -> None:
        self.identity, self._sealing = Identity.make(), X25519PrivateKey.generate()
        self._session, self._callers = session, list[Caller]()
        self.answers: list[Message] = []
        """To requests, one after the other; a ticket is followed by the match's ending."""
        session.answer(topics.join("pit"), self._on_join)
        session.answer(topics.lobby("pit"), self._on_lobby)
        session.subscribe(topics.all_actions("pit"), lambda _: self._end())

    def _on_join(self, query: Query) -> None:
        if decode(query.payload) == ChallengeRequest():
            return query.answer(encode(self._challenge()))
        caller = open_request(query.payload, "pit", self.identity.public, self._sealing)
        self._callers.append(caller)
        answer: Message = Done(text=TRAP) if isinstance(caller.request, AdminRequest) else self.answers.pop(0)
        return query.answer(caller.answer(answer))

    def _challenge(self) -> Challenge:
        sealing_key = self._sealing.public_key().public_bytes_raw()
        return sign_challenge("pit", self.identity, sealing_key, new_secret())

    def _on_lobby(self, query: Query) -> None:
        rules = {"name": TRAP, **to_dict(load("paper"))}
        query.answer(
            encode(
                sign_statement(
                    self.identity,
                    Lobby(
                        pit=TRAP, rules=TRAP, rules_hash=TRAP, ruleset=rules, needs_invite=False, n_begun=1,
                        running=[{"match": MATCH, "blue": TRAP, "red": TRAP, "tick": 1}], waiting=[TRAP],
                        standings=[{"name": TRAP, "rating": 1.0}],
                    ),
                )
            )
        )  # fmt: skip
        self._session.publisher(topics.public("pit", MATCH))[0](encode(sign_statement(self.identity, self._ended())))

    def _ended(self) -> Ended:
        faults = {"blue": {TRAP: 3}}
        return Ended(match=MATCH, ending="forfeit", winner="red", score=0, ticks=1, reason=TRAP, faults=faults)

    def ticket(self) -> Ticket:
        commitment = sign_statement(self.identity, Commitment(match=MATCH, digest=commit(MATCH, KEYS)))
        return Ticket(
            match=MATCH, lane=0, team=int(Team.BLUE), ruleset={"name": TRAP, **to_dict(load("paper"))}, opponent=TRAP,
            turn_time_s=None, bank_s=0.0, tick=0, secret=bytes(32), commitment=encode(commitment),
        )  # fmt: skip

    def _end(self) -> None:
        sealer, _ = self._callers[-1].sit(MATCH, Team.BLUE, bytes(32), 64)
        data = sealer.close(encode(sign_statement(self.identity, self._ended())), 0)
        self._session.publisher(topics.observation("pit", 0, Team.BLUE))[0](data)


@pytest.fixture
def pit(port: int) -> Iterator[HostilePit]:
    with open_router(f"tcp/127.0.0.1:{port}", "pit") as session:
        yield HostilePit(session)


def check(done: subprocess.CompletedProcess[str], *, is_shown: bool = True) -> None:
    """Check that nothing which a terminal obeys was printed, and no line of the pit's own making."""
    said = done.stdout + done.stderr
    assert all(letter.isprintable() or letter == "\n" for letter in said), said
    assert not any(line.startswith("3 of 3 journals hold") for line in said.splitlines()), said
    assert "Traceback" not in said
    assert (SHOWN in said) is is_shown, said


def test_a_refusal_and_a_wait_are_shown_and_not_obeyed(here: Run, pit: HostilePit, port: int, tmp_path: Path) -> None:
    pit.answers = [Wait(reason=TRAP), Refusal(reason=TRAP)]

    done = here("join", f"arena://127.0.0.1:{port}/pit", "--data", tmp_path)

    assert done.returncode == 1
    assert done.stderr.count(SHOWN) == 2
    check(done)


def test_an_opponent_a_ruleset_and_an_ending_are_shown_and_not_obeyed(
    here: Run, pit: HostilePit, port: int, tmp_path: Path
) -> None:
    pit.answers = [pit.ticket()]

    done = here("join", f"arena://127.0.0.1:{port}/pit", "--data", tmp_path, "--no-audit")

    assert done.returncode == 0, done.stderr
    assert f"match {MATCH}: blue against {SHOWN}, rules {SHOWN}" in done.stderr
    assert f"loss as blue by forfeit ({SHOWN}) after 1 ticks, score +0; counted: 3 {SHOWN}" in done.stdout
    check(done)
    [transcript] = (tmp_path / "transcripts").iterdir()
    check(here("replay", "show", transcript))


def test_the_ending_of_a_watched_match_is_shown_and_not_obeyed(here: Run, pit: HostilePit, port: int) -> None:
    check(here("watch", "--pit", f"arena://127.0.0.1:{port}/pit"))


@pytest.mark.parametrize("form", [[], ["--json"]])
def test_a_lobby_is_shown_and_not_obeyed(here: Run, pit: HostilePit, port: int, form: list[str]) -> None:
    done = here("doctor", "--pit", f"arena://127.0.0.1:{port}/pit", *form)

    check(done, is_shown=not form)
    assert not form or r"\u001b]0;owned\u0007" in done.stdout


def test_the_answer_to_an_operator_is_shown_and_not_obeyed(here: Run, pit: HostilePit, port: int, tmp_path: Path) -> None:
    key = tmp_path / "keys" / "pit.key"
    key.parent.mkdir()
    key.touch(mode=0o600)
    key.write_bytes(pit.identity.private.private_bytes(Encoding.PEM, PrivateFormat.PKCS8, NoEncryption()))

    check(here("admin", "close", "--pit", f"arena://127.0.0.1:{port}/pit", "--data", tmp_path))


@pytest.mark.parametrize("form", ["text", "json"])
def test_names_on_a_ladder_are_shown_and_not_obeyed(here: Run, tmp_path: Path, form: str) -> None:
    players = {team: LadderEntry(key=team.name, name=f"{TRAP}{team.name}", mu=30.0) for team in Team}
    names, keys = {team: players[team].name for team in Team}, {team: team.name.encode() for team in Team}
    result = MatchResult(ending=Termination.CAPTURE, winner=Team.BLUE, score=100, ticks=3)
    with LadderStore(str(tmp_path / "arena.db")) as store:
        store.count_match("pit", LadderMatch(identity="x", names=names, entries=keys, rules_hash="r", result=result), players)

    done = here("leaderboard", "--ladder", "--data", tmp_path, "--format", form)

    assert done.returncode == 0, done.stderr
    check(done, is_shown=form == "text")


def test_a_journal_is_shown_and_not_obeyed(here: Run, tmp_path: Path, trapped_journal: Path) -> None:
    for command in (["verify", "--local"], ["verify", "--local", "--json"], ["show"]):
        check(here("replay", *command, trapped_journal), is_shown=command == ["show"])


@pytest.fixture
def trapped_journal(tmp_path: Path) -> Path:
    from arena.local.venue import play_batch
    from arena.records.plan import MatchPlan
    from policies import registry

    rules = replace(load("paper"), name=TRAP)
    plan = MatchPlan(identity="x", blue=TRAP, red=TRAP, keys=KEYS)
    [record] = play_batch(rules, [plan], registry.load("rush"), registry.load("rush"))
    assert record.journal is not None
    path = tmp_path / "\u202etrapped\x1b[2J.journal"
    path.write_bytes(record.journal)
    return path
