"""The desk of a season, over a real router: who may submit what, when, and what each is told."""

from collections.abc import Callable
from pathlib import Path

import pytest
from authors import BOT, SEASON, Author, Season, pack, read_refusal, refusal

from arena.protocol.codec import encode
from arena.protocol.identity import Identity
from arena.protocol.messages import AdminRequest, ChallengeRequest, JoinRequest, SealedRequest, SeasonAnswer, SeasonRequest
from arena.records.journal import journal_name
from arena.records.plan import LeagueMatchId
from arena.submission import PIECE_BYTES, Submission, digest_of
from tournaments.league.season import FINAL_SUFFIX, most_name_letters
from tournaments.season import owners
from tournaments.season.desk import MOST_WAITING
from tournaments.store.season_store import WAITING

OpenSeason = Callable[..., Season]
Connect = Callable[..., Author]
LARGE = Submission(kind="bot", main="bot.py", files={"bot.py": BOT, "weights.bin": bytes(2 * PIECE_BYTES)}).pack()


def accept(season: Season) -> None:
    """Take all that waits, without a check."""
    for one in season.store.submissions(season.row, state=WAITING):
        season.store.accept(season.row, one, spec="x", says="it plays", report=None, now_s=season.now_s)


def test_a_submission_comes_in_pieces_and_waits_for_its_check(open_season: OpenSeason, author: Connect) -> None:
    season = open_season()
    ann, bob = author(season), author(season, "bob")

    first, second = ann.upload(LARGE), bob.upload(pack())

    assert isinstance(first, SeasonAnswer)
    assert isinstance(second, SeasonAnswer)
    assert (first.text, second.text) == ("it waits for its check", "it waits for its check after 1 other")
    waiting = season.store.submissions(season.row, state=WAITING)
    assert [(one.entry, one.owner, one.digest, one.n_bytes) for one in waiting] == [
        ("ann", ann.identity.fingerprint, digest_of(LARGE), len(LARGE)),
        ("bob", bob.identity.fingerprint, digest_of(pack()), len(pack())),
    ]
    assert season.kept() == sorted([f"{digest_of(LARGE)}.ann.packed", f"{digest_of(pack())}.bob.packed"])


def test_an_upload_that_broke_off_goes_on_where_it_stood(open_season: OpenSeason, author: Connect) -> None:
    season = open_season()
    ann = author(season)
    announced = {"digest": bytes.fromhex(digest_of(LARGE)), "n_bytes": len(LARGE)}

    ann.ask("upload", piece=LARGE[:PIECE_BYTES], **announced)
    again = ann.ask("upload", piece=LARGE[:PIECE_BYTES], **announced)

    assert isinstance(again, SeasonAnswer)
    assert again.offset == PIECE_BYTES


def test_what_cannot_be_taken_is_refused_in_a_sentence_and_nothing_is_kept(open_season: OpenSeason, author: Connect) -> None:
    season = open_season()
    ann = author(season)
    upwards = pack().replace(b"\xa6bot.py", b"\xa6../.py")

    assert "has 200,001 bytes, and this season takes 200,000" in refusal(ann.upload(bytes(200_001)))
    assert "the submission is none" in refusal(ann.upload(b"PK\x03\x04"))
    assert "of another format" in refusal(ann.upload(b"arena submission 9\n"))
    assert "leads out of the folder" in refusal(ann.upload(upwards))
    assert "not what was announced" in refusal(ann.upload(pack(), digest=bytes(32)))
    assert "1 to 64 letters" in refusal(ann.upload(pack(), name="../ann"))
    assert "1 to 64 letters" in refusal(ann.upload(pack(), name="ann.2"))
    assert "look like a public key" in refusal(ann.upload(pack(), name=ann.identity.fingerprint))
    assert "there is no command 'steal'" in refusal(ann.ask("steal"))
    assert season.kept() == []
    assert season.store.submissions(season.row) == []


def test_what_nobody_signed_or_another_did_gets_nothing(open_season: OpenSeason, author: Connect) -> None:
    season = open_season()
    ann, eve = author(season), author(season, "eve")
    attempt = ann.attempt(SeasonRequest(command="status", name="ann"))

    class Forger(Identity):
        def sign(self, label: str, data: bytes) -> bytes:
            return eve.identity.sign(label, data)

    forged = Author(season, "ann", Forger(ann.identity.private))
    with forged.session:
        assert "the signature of a request does not hold" in read_refusal(
            ann.send(forged.attempt(SeasonRequest(command="withdraw", name="ann")).sealed)
        )
    assert "the request is not taken" in read_refusal(ann.send(b"junk"))
    assert "does not open" in read_refusal(ann.send(encode(SealedRequest(sealed=b"junk" * 20))))
    assert "this is no request to a season" in read_refusal(ann.send(encode(SeasonRequest(command="status", name="ann"))))
    assert "speaks version 3 of the protocol" in read_refusal(ann.send(encode(ChallengeRequest(), version=3)))
    ann.send(attempt.sealed)
    assert "comes a second time" in read_refusal(ann.send(attempt.sealed))
    for other in (JoinRequest(rules_version=1, name="ann", team="any", client="c", slot=0), AdminRequest(command="x", target="")):
        sealed = ann.attempt(other)  # type: ignore[arg-type]
        assert "takes submissions here" in refusal(sealed.open(ann.send(sealed.sealed)))
    assert season.store.submissions(season.row) == []


def test_a_name_belongs_to_the_first_key(open_season: OpenSeason, author: Connect) -> None:
    season = open_season()
    ann, eve = author(season), author(season, "ann")
    ann.upload(pack())

    assert "the name ann belongs to another key" in refusal(eve.upload(pack(b"# eve's\n" + BOT)))
    accept(season)
    for command in ("status", "log", "roll-back", "withdraw"):
        assert "you have no entry ann" in refusal(eve.ask(command))
    assert "the name ann belongs to another key" in refusal(eve.upload(pack(b"# eve's\n" + BOT)))
    assert "the name ann belongs to another key" in refusal(eve.ask("remote"))
    assert "the name rush belongs to another key" in refusal(eve.upload(pack(), name="rush"))
    assert [one.entry for one in season.store.submissions(season.row)] == ["ann"]


def test_whoever_had_submitted_under_a_name_before_withdraws_nothing_of_who_has_it_now(
    open_season: OpenSeason, author: Connect
) -> None:
    season = open_season()
    ann, eve = author(season), author(season, "ann")
    eve.upload(pack())
    eve.ask("withdraw")
    ann.upload(pack(BOT + b"# ann's\n"))

    eve.ask("withdraw")

    assert [one.owner for one in season.store.submissions(season.row, state=WAITING)] == [ann.identity.fingerprint]


def test_one_owner_has_as_many_entries_and_submissions_as_the_season_allows(open_season: OpenSeason, author: Connect) -> None:
    season = open_season(entries_per_owner=2, per_day=3)
    ann = author(season)

    ann.upload(pack(), name="one")
    assert "a version of one waits for its check" in refusal(ann.upload(LARGE, name="one"))
    ann.upload(pack(), name="two")
    assert "takes 2 entries of one owner, and you have one, two" in refusal(ann.upload(pack(), name="three"))
    accept(season)
    ann.ask("withdraw", name="two")
    ann.upload(pack(), name="three")
    assert "takes 3 submissions of one owner in 24 hours" in refusal(ann.upload(LARGE, name="one"))
    season.now_s += 86_401
    assert isinstance(ann.upload(LARGE, name="one"), SeasonAnswer)
    accept(season)
    assert "takes 2 entries of one owner, and you have one, three" in refusal(ann.ask("roll-back", name="two", number=1))


def test_nothing_is_taken_after_the_deadline_but_entries_can_be_withdrawn(open_season: OpenSeason, author: Connect) -> None:
    season = open_season(deadline_s=1_000_060.0)
    ann = author(season)
    ann.upload(pack())
    accept(season)

    season.now_s += 60

    for answer in (ann.upload(LARGE), ann.ask("remote"), ann.ask("roll-back", number=1)):
        assert refusal(answer) == "the deadline was 1970-01-12 13:47 UTC; what comes after it is not taken"
    assert isinstance(ann.ask("withdraw"), SeasonAnswer)


def test_whoever_goes_to_and_fro_has_to_wait(open_season: OpenSeason, author: Connect) -> None:
    season = open_season()
    ann = author(season)
    ann.upload(pack())
    accept(season)

    answers = [ann.ask("roll-back", number=1) for _ in range(6)]

    assert [type(answer) for answer in answers[:5]] == [SeasonAnswer] * 5
    assert "5 times in a minute; try again in one" in refusal(answers[5])


def test_without_an_invite_nobody_holds_a_buffer(open_season: OpenSeason, author: Connect) -> None:
    season = open_season(invites=["code"], entries_per_owner=2)
    ann, eve = author(season), author(season, "eve")

    assert refusal(eve.upload(LARGE)) == "this season wants an invite code; submit with --invite CODE"
    assert refusal(eve.upload(LARGE, invite="guess")) == "the invite code is none of this season's"
    assert season.owners.n_held_bytes == 0
    assert isinstance(ann.upload(LARGE, invite="code"), SeasonAnswer)
    assert refusal(eve.upload(LARGE, invite="code")) == "the invite code was used by another key"
    assert isinstance(ann.upload(pack(), name="two"), SeasonAnswer)


def test_an_owner_goes_back_to_a_version_and_forth(open_season: OpenSeason, author: Connect) -> None:
    season = open_season()
    ann = author(season)
    for code in (BOT, BOT + b"# two\n"):
        ann.upload(pack(code))
        accept(season)

    assert "this is version 2 of ann, which plays already" in refusal(ann.upload(pack(BOT + b"# two\n")))
    assert "to play it again: --roll-back 1" in refusal(ann.upload(pack()))
    assert "ann has no version 3; it has 1, 2" in refusal(ann.ask("roll-back", number=3))
    assert ann.ask("roll-back", number=1) == SeasonAnswer(text="version 1 of ann plays from now on")
    ann.ask("withdraw")
    assert list(season.store.get(SEASON).definition["entries"]) == ["rush"]
    ann.ask("roll-back", number=2)
    assert list(season.store.get(SEASON).definition["entries"]) == ["ann.2", "rush"]


def test_an_entry_of_its_owner_s_machine_is_a_version_like_others(open_season: OpenSeason, author: Connect) -> None:
    season = open_season()
    ann = author(season)

    answer = ann.ask("remote")

    assert answer == SeasonAnswer(text="version 1 of ann plays as soon as it joins")
    [version] = [one for one in season.store.versions(season.row) if one.entry == "ann"]
    assert version.spec == f"key:{ann.identity.fingerprint}"
    assert "plays already" in refusal(ann.ask("remote"))


def test_the_owner_alone_is_told_how_an_entry_stands_and_what_it_printed(open_season: OpenSeason, author: Connect) -> None:
    season = open_season()
    ann = author(season)
    ann.upload(pack())
    waiting = ann.ask("status")
    accept(season)
    (season.logs / "ann.log").write_bytes(b"x" * 300_000 + b"the last words")

    playing, log, offset = ann.ask("status"), b"", 0
    while True:
        part = ann.ask("log", offset=offset)
        assert isinstance(part, SeasonAnswer)
        if not part.data:
            break
        log, offset = log + part.data, part.offset

    assert isinstance(waiting, SeasonAnswer)
    assert isinstance(playing, SeasonAnswer)
    assert (waiting.text, waiting.facts["queue"]) == ("ann waits for its check, as number 1 of the queue", 1)
    assert (playing.text, playing.facts["plays"], playing.facts["queue"]) == ("version 1 of ann plays", 1, None)
    assert [one["number"] for one in playing.facts["versions"]] == [1]
    assert log.endswith(b"the last words")
    assert len(log) == 200_000


@pytest.mark.parametrize(("season", "most"), [("course", 64), ("s" * 64, 49)])
def test_no_name_is_too_long_for_the_file_of_a_journal(season: str, most: int, tmp_path: Path) -> None:
    assert most_name_letters(season) == most
    for suffix, name in (("", season + FINAL_SUFFIX), (".9999", season)):
        label = "x" * most + suffix
        match = LeagueMatchId(league=name, one=label, other=label, pair=99_999, blue=label)
        (tmp_path / journal_name(str(match))).touch()


def test_a_name_that_is_too_long_is_refused(open_season: OpenSeason, author: Connect, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(owners, "most_name_letters", lambda _: 50)
    season = open_season()
    ann = author(season)

    for answer in (ann.upload(pack(), name="a" * 51), ann.ask("remote", name="a" * 51)):
        assert "is too long; in this season, it may have 50 letters" in refusal(answer)


def test_a_part_of_a_log_that_no_file_has_is_empty(open_season: OpenSeason, author: Connect) -> None:
    season = open_season()
    ann = author(season)
    ann.upload(pack())
    accept(season)
    (season.logs / "ann.log").write_bytes(b"the last words")

    for offset in (2**62, 2**63 - 1, 2**64 - 1):
        assert ann.ask("log", offset=offset) == SeasonAnswer(text="ann.log", offset=14)
    assert ann.ask("log", offset=-(2**63)) == SeasonAnswer(text="ann.log", offset=14, data=b"the last words")


def test_a_flood_of_junk_leaves_an_author_served(open_season: OpenSeason, author: Connect) -> None:
    season = open_season()
    ann, eve = author(season), author(season, "eve")
    for _ in range(4 * MOST_WAITING):
        eve.session.ask(f"arena/{SEASON}/submissions", encode(SealedRequest(sealed=bytes(50_000))), lambda _: None, 30.0)

    assert isinstance(ann.upload(LARGE), SeasonAnswer)
