"""Who may see which journal, and when: the archive decides, and reads no file."""

from collections.abc import Callable
from typing import Any

import pytest

from arena.game.ruleset import Ruleset
from arena.pit import archive as module
from arena.pit.archive import Archive
from arena.pit.effects import Reply, ReplyWithJournal
from arena.pit.events import JournalAsked
from arena.protocol.codec import MOST_BYTES, decode, encode
from arena.protocol.messages import ChallengeRequest, JournalPiece, JournalRequest, Message, Refusal, Wait
from arena.records.journal import Header

HeaderOf = Callable[[str], Header]


@pytest.fixture
def header_of(small_rules: Ruleset, planned: Callable[..., Any]) -> HeaderOf:
    return lambda identity: Header(identity=identity, blue="one", red="other", ruleset=small_rules, keys=planned(identity).keys)


@pytest.fixture
def archive(header_of: HeaderOf) -> Archive:
    """Return an archive with one match, `m`, that anybody may see."""
    one = Archive(lambda names: True)
    one.add("m", header_of("pit/0"))
    return one


def sent(archive: Archive) -> list[Any]:
    """Return what waited to be sent."""
    return [archive.replies.take() for _ in iter(lambda: archive.replies.may_take(is_rationed=False), False)]


def ask(archive: Archive, match: str = "m", payload: bytes | None = None, offset: int = 0) -> ReplyWithJournal | Message | None:
    asked = JournalAsked(7, match, encode(JournalRequest(offset=offset)) if payload is None else payload)
    effects = archive.answer(asked) or sent(archive)
    if not effects:
        return None
    [effect] = effects
    assert isinstance(effect, Reply | ReplyWithJournal)
    assert effect.question == 7
    return decode(effect.payload) if isinstance(effect, Reply) else effect


@pytest.mark.parametrize("offset", [0, 1, 2**63])
def test_a_piece_may_be_asked_for_from_anywhere(archive: Archive, offset: int) -> None:
    assert ask(archive, offset=offset) == ReplyWithJournal(7, "pit+0.journal", offset)


@pytest.mark.parametrize("match", ["other", "", "m/..", "../m", "*", "pit+0.journal"])
def test_a_match_that_is_not_there_is_refused(archive: Archive, match: str) -> None:
    assert ask(archive, match) == Refusal(reason=f"there is no journal of a match {match}, or the match is not over")


@pytest.mark.parametrize(
    ("payload", "why"),
    [
        (b"", "the request cannot be read: the bytes are not msgpack"),
        (b"\xc1" * 10, "the request cannot be read: the bytes are not msgpack"),
        (bytes(MOST_BYTES + 1), "the request cannot be read: "),
        (encode(JournalRequest(offset="0")), "the request cannot be read: JournalRequest.offset is of another type"),  # type: ignore[arg-type]
        (encode(JournalRequest(offset=-1)), "this is no request for a journal"),
        (encode(ChallengeRequest()), "this is no request for a journal"),
        (encode(JournalPiece(n_bytes=1, offset=0, data=b"x")), "this is no request for a journal"),
    ],
)
def test_what_is_no_request_is_refused(archive: Archive, payload: bytes, why: str) -> None:
    answer = ask(archive, payload=payload)

    assert isinstance(answer, Refusal)
    assert answer.reason.startswith(why)


def test_a_journal_whose_fixture_is_not_over_is_to_be_waited_for(header_of: HeaderOf) -> None:
    over: list[set[str]] = []
    archive = Archive(lambda names: names in over)
    archive.add("m", header_of("pit/0"))

    assert ask(archive) == Wait(reason="until the last match of these two is over")
    over.append({"one", "other"})
    assert isinstance(ask(archive), ReplyWithJournal)


def test_questions_for_a_journal_that_will_be_whole_in_a_moment_wait_up_to_a_bound(header_of: HeaderOf) -> None:
    archive = Archive(lambda names: True)
    archive.expect("m")
    answers = [ask(archive) for _ in range(module._MOST_ASKED + 1)]

    assert answers[:-1] == [None] * module._MOST_ASKED
    assert isinstance(answers[-1], Refusal)
    assert archive.add("m", header_of("pit/0")) == []
    assert sent(archive) == [ReplyWithJournal(7, "pit+0.journal", 0)] * module._MOST_ASKED


def test_the_oldest_of_too_many_matches_are_forgotten(header_of: HeaderOf, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "MOST_KEPT", 3)
    archive = Archive(lambda names: True)
    for number in range(5):
        archive.add(f"m{number}", header_of(f"pit/{number}"))

    assert [isinstance(ask(archive, f"m{number}"), ReplyWithJournal) for number in range(5)] == [False, False, True, True, True]
