"""Who plays whom on a ladder, and what a pit that was killed still owes to it."""

import logging
from collections.abc import Collection, Sequence
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import pytest
from offline_pit import OfflinePit, Player

from arena.game.keys import MatchKeys
from arena.game.ruleset import load, rules_values
from arena.game.types import RULES_VERSION, Team, Termination
from arena.match.match import Match
from arena.match.time_control import TimeControl
from arena.network.address import Address
from arena.pit import admission
from arena.pit.core import MOST_STANDINGS
from arena.pit.effects import MatchEnded
from arena.pit.ladder import MOST_CONSIDERED, MOST_OF_OWNER, Ladder, LadderMatch, LadderSeating, Waiting, find_uncounted
from arena.pit.pit import Pit, PitSettings, _next_number
from arena.pit.register import Register
from arena.pit.seating import object_to
from arena.pit.seats import SlotId
from arena.policy import MatchResult
from arena.protocol import signed as facts
from arena.protocol.codec import MOST_BYTES, MOST_LISTED, encode
from arena.protocol.identity import Identity
from arena.protocol.messages import Closed, JoinRequest, Lobby, Refusal, Wait
from arena.records.journal import Header, journal_name, write_ending, write_seats
from arena.records.plan import MatchPlan, network_name

KEYS = MatchKeys(map_key=bytes(32), match_key=bytes(32))
RULES = load("paper").with_({"side": 10})


class FirstTwo:
    """A ladder that lets the first two meet, once it is told to."""

    def __init__(self) -> None:
        self.is_open = True
        self.asked: list[Sequence[Waiting]] = []

    def identities(self) -> Collection[str]:
        return ()

    def choose(self, waiting: Sequence[Waiting], now_s: float) -> tuple[Waiting, Waiting] | None:
        self.asked.append(waiting)
        return (waiting[0], waiting[1]) if self.is_open else None

    def count(self, match: LadderMatch) -> None:
        raise AssertionError("a seating counts nothing")

    def standings(self) -> list[dict[str, Any]]:
        return [{"name": "ann"}]


def plan(blue: str, red: str) -> MatchPlan:
    return MatchPlan(identity=f"{blue}/{red}", blue=blue, red=red, keys=KEYS)


def seating(ladder: FirstTwo | None = None, n_matches: int | None = None) -> LadderSeating:
    return LadderSeating(ladder or FirstTwo(), plan, n_matches)


def seat(name: str, slot: int = 0) -> SlotId:
    return SlotId(name.encode(), name, slot)


def place(
    at: LadderSeating, name: str, slot: int = 0, team: str = "any", called: str = "", now_s: float = 7.0, version: str = ""
) -> Any:
    request = JoinRequest(
        rules_version=RULES_VERSION, name=called or name, team=team, client=name, slot=slot, entry=name.encode(), version=version
    )
    return at.place(seat(name, slot), request, now_s)


def pair_up(at: LadderSeating) -> tuple[str, SlotId, SlotId] | None:
    pairing = at.pair_up(9.0)
    return pairing and (pairing.plan.identity, pairing.slots[Team.BLUE], pairing.slots[Team.RED])


def test_two_that_wait_meet_when_the_ladder_says_so() -> None:
    ladder = FirstTwo()
    ladder.is_open = False
    at = seating(ladder)
    assert isinstance(place(at, "ann"), Wait)
    assert isinstance(place(at, "bob"), Wait)
    assert pair_up(at) is None

    ladder.is_open = True

    assert pair_up(at) == ("ann/bob", seat("ann"), seat("bob"))
    assert pair_up(at) is None
    assert [waiting.since_s for waiting in ladder.asked[0]] == [7.0, 7.0]


def test_nobody_meets_an_entry_of_the_same_key() -> None:
    at = seating()
    place(at, "ann", slot=0)
    place(at, "ann", slot=1, called="anna")

    assert pair_up(at) is None

    place(at, "bob")
    assert pair_up(at) == ("ann/bob", seat("ann"), seat("bob"))


def test_the_seats_of_one_entry_wait_in_line_behind_the_other_entries() -> None:
    at = seating()
    for slot in range(3):
        place(at, "ann", slot)
    for name in ("bob", "cid", "dan"):
        place(at, name)

    assert [pair_up(at), pair_up(at), pair_up(at)] == [
        ("ann/bob", seat("ann"), seat("bob")),
        ("cid/dan", seat("cid"), seat("dan")),
        None,
    ]


def test_a_crowd_of_seats_of_one_key_keeps_nobody_out() -> None:
    at = seating()
    for slot in range(2 * MOST_CONSIDERED):
        place(at, "ann", slot)
    place(at, "bob")

    assert pair_up(at) == ("ann/bob", seat("ann"), seat("bob"))


def test_the_ladder_chooses_among_those_who_have_waited_longest() -> None:
    ladder = FirstTwo()
    at = seating(ladder)
    for number in range(MOST_CONSIDERED + 3):
        place(at, f"n{number}")

    pair_up(at)

    assert [one.entry for one in ladder.asked[0]] == [f"n{number}".encode() for number in range(MOST_CONSIDERED)]


def test_a_crowd_of_entries_of_one_owner_keeps_nobody_out() -> None:
    ladder = FirstTwo()
    at = LadderSeating(ladder, plan, None, owner_of=lambda entry: "eve" if entry.startswith(b"eve") else entry.decode())
    for number in range(2 * MOST_CONSIDERED):
        place(at, f"eve{number}")
    place(at, "ann")

    pair_up(at)

    assert [one.owner for one in ladder.asked[0]] == ["eve"] * MOST_OF_OWNER + ["ann"]


def test_the_ladder_hears_of_the_version_that_was_told_last() -> None:
    ladder = FirstTwo()
    at = seating(ladder)
    for version in ("old", "new", ""):
        place(at, "ann", version=version)
    place(at, "bob")

    pair_up(at)

    assert [one.version for one in ladder.asked[0]] == ["new", ""]


def test_a_version_that_is_no_chunk_is_refused() -> None:
    request = JoinRequest(rules_version=RULES_VERSION, name="ann", team="any", client="c", slot=0, version="a b")

    assert object_to(request, RULES, has_versions=False) == "a version is 1 to 64 letters, digits, - or _"


def test_who_asks_again_has_waited_all_the_while() -> None:
    ladder = FirstTwo()
    at = seating(ladder)
    for now_s, name in enumerate(("ann", "bob", "ann"), 1):
        place(at, name, now_s=now_s)

    pair_up(at)

    assert [one.since_s for one in ladder.asked[0]] == [1.0, 2.0]


def test_who_is_forgotten_meets_nobody() -> None:
    at = seating()
    place(at, "ann")
    place(at, "bob")
    at.forget(seat("ann"))
    at.forget(seat("nobody"))

    assert pair_up(at) is None


def test_teams_are_given_out_by_the_pit() -> None:
    answer = place(seating(), "ann", team="red")

    assert answer == Refusal(reason="on a ladder the pit gives out the teams; join with --team any")


def test_after_the_last_match_and_after_close_none_begins() -> None:
    at = seating(n_matches=1)
    for name in ("ann", "bob", "cid", "dan"):
        place(at, name)

    assert pair_up(at) is not None
    assert at.is_done
    assert pair_up(at) is None
    assert isinstance(place(at, "eve"), Closed)

    at = seating()
    at.close()
    assert at.is_done
    assert isinstance(place(at, "ann"), Closed)


def test_it_plans_nothing_and_tells_the_standings() -> None:
    at = seating()

    assert not at.is_planned({"ann", "bob"})
    assert at.standings() == [{"name": "ann"}]


def test_a_match_begins_as_time_passes_if_there_is_room(monkeypatch: pytest.MonkeyPatch) -> None:
    ladder = FirstTwo()
    pit = OfflinePit(seating(ladder))
    ladder.is_open = False
    players = [Player(pit, name) for name in ("ann", "bob")]
    assert [player.ask() for player in players] == [None, None]
    ladder.is_open = True
    monkeypatch.setattr(admission, "MOST_RUNNING", 0)
    pit.pass_time()
    assert pit.core.n_running == 0

    monkeypatch.undo()
    pit.pass_time()

    assert [player.take().team for player in players] == list(Team)
    assert pit.lobby().standings == [{"name": "ann"}]


# What a killed pit owes


def write_journal(folder: Path, identity: str, *, has_ended: bool = True) -> None:
    """Write the journal of a match that red forfeited before its first tick."""
    pit, ann, bob = Identity.make(), Identity.make(), Identity.make()
    header = Header(identity=identity, blue="ann", red="bob", ruleset=RULES, keys=KEYS)
    match = Match(header, TimeControl(), 0.0)
    name = network_name(identity, b"", b"")
    commitment = facts.Commitment(match=name, digest=facts.commit(name, KEYS))
    seals = write_seats(
        pit.public, {Team.BLUE: ann.public, Team.RED: bob.public}, facts.sign_statement(pit, commitment).signature
    )
    data = match.start_record + seals
    if has_ended:
        match.forfeit(Team.RED, "was removed")
        assert match.result is not None
        data += write_ending(match.start_record[-32:], match.result)
    (folder / journal_name(identity)).write_bytes(data)


def test_results_that_were_lost_with_a_pit_are_found_in_its_journals(tmp_path: Path) -> None:
    for number in range(3):
        write_journal(tmp_path, f"pit/ladder/{number:06}/ann/bob", has_ended=number != 1)

    [found] = find_uncounted(tmp_path, "pit", {"pit/ladder/000000/ann/bob"})

    assert found.identity == "pit/ladder/000002/ann/bob"
    assert found.names == {Team.BLUE: "ann", Team.RED: "bob"}
    assert (found.result.ending, found.result.winner) == (Termination.FORFEIT, Team.BLUE)
    assert found.rules_hash == RULES.hash
    assert len(set(found.entries.values())) == 2


def test_matches_of_other_pits_and_without_a_ladder_are_not_counted(tmp_path: Path) -> None:
    for identity in ("pit/000000/ann/bob", "pond/ladder/000000/ann/bob", "pit2/ladder/000000/ann/bob"):
        write_journal(tmp_path, identity)

    assert list(find_uncounted(tmp_path, "pit", ())) == []


def test_a_journal_that_does_not_hold_is_not_counted(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    write_journal(tmp_path, "pit/ladder/000000/ann/bob")
    [path] = tmp_path.iterdir()
    data = bytearray(path.read_bytes())
    data[-1] ^= 1
    path.write_bytes(data)

    with caplog.at_level(logging.WARNING):
        assert list(find_uncounted(tmp_path, "pit", ())) == []

    assert "is not counted" in caplog.text


def test_no_number_is_given_twice_to_matches_with_a_journal_or_a_result(tmp_path: Path) -> None:
    assert _next_number(tmp_path, "pit", (), is_rated=True) == 0
    for identity in ("pit/ladder/000004/ann/bob", "pit/000007/ann/bob", "pit2/ladder/000030/ann/bob"):
        (tmp_path / journal_name(identity)).touch()

    assert _next_number(tmp_path, "pit", (), is_rated=True) == 5
    assert _next_number(tmp_path, "pit", {"pit/ladder/000011/ann/bob", "pit/ladder/000002/ann/bob"}, is_rated=True) == 12
    assert _next_number(tmp_path, "pit", (), is_rated=False) == 8


def test_a_match_that_was_begun_without_the_ladder_is_not_counted(tmp_path: Path) -> None:
    counted: list[str] = []
    reported: list[str] = []
    ladder = SimpleNamespace(count=lambda match: counted.append(match.identity))
    identity = Identity.make()
    pit = Pit(
        PitSettings(
            address=Address(), identity=identity, spectator_key=bytes(32), register=Register(), ruleset=RULES, secret=bytes(32),
            time_control=TimeControl(), journals=tmp_path, ladder=cast(Ladder, ladder),
        )
    )  # fmt: skip

    for name in ("pit/000001/ann/bob", "pit/ladder/000001/ann/bob"):
        header = Header(identity=name, blue="ann", red="bob", ruleset=RULES, keys=KEYS)
        result = MatchResult(ending=Termination.CAPTURE, winner=None, score=0, ticks=9, reason="")
        ended = MatchEnded(header=header, result=result, seats={}, entries=dict.fromkeys(Team, identity.public))
        pit._report(ended, lambda ended: reported.append(ended.header.identity))

    assert counted == ["pit/ladder/000001/ann/bob"]
    assert reported == ["pit/000001/ann/bob", "pit/ladder/000001/ann/bob"]


# Around it


def test_the_longest_lobby_fits_one_message() -> None:
    name, number = "n" * 64, 123_456.789
    standing = {
        "name": name, "rating": number, "mu": number, "sigma": number, "wins": 1 << 31, "draws": 1 << 31, "losses": 1 << 31,
        "forfeits": 1 << 31,
    }  # fmt: skip
    lobby = Lobby(
        pit=name,
        rules=name,
        rules_hash=name,
        ruleset={**rules_values(load("paper")), "board": "#" * 64 * 64},
        needs_invite=True,
        n_begun=1 << 31,
        running=[{"match": "m" * 16, "blue": name, "red": name, "tick": 1 << 31}] * MOST_LISTED,
        waiting=[name] * MOST_LISTED,
        standings=[standing] * MOST_STANDINGS,
    )

    assert len(encode(facts.sign_statement(Identity.make(), lobby))) <= MOST_BYTES
