"""The operator's commands, by a core without a network."""

import pytest
from offline_pit import PIT, OfflinePit, Player, begin, play

from arena.game.types import Team, Termination
from arena.protocol.identity import Identity
from arena.protocol.messages import Closed, Done, Ended, Refusal


@pytest.fixture
def pit() -> OfflinePit:
    return OfflinePit()


@pytest.fixture
def operator(pit: OfflinePit) -> Player:
    return Player(pit, "operator", PIT)


def test_only_the_holder_of_the_pit_s_key_is_obeyed(pit: OfflinePit) -> None:
    ann, _ = begin(pit)
    for command in ("kick", "ban", "close", "abort", "release-name", "anything"):
        for stranger in (ann, Player(pit, "operator")):
            assert stranger.command(command, "ann") == Refusal(reason="only the holder of the pit's key is obeyed")

    assert pit.ended == []
    assert not pit.seating.is_done


def test_a_command_that_is_none_is_refused_with_those_that_are(operator: Player) -> None:
    assert operator.command("reboot", "x") == Refusal(
        reason="there is no command 'reboot'; it is one of kick, ban, close, abort, release-name"
    )


@pytest.mark.parametrize("by", ["name", "key"])
def test_an_entry_that_is_kicked_forfeits_and_is_sent_away_and_may_come_back(pit: OfflinePit, operator: Player, by: str) -> None:
    ann, bob = begin(pit)
    ann.send_request(slot=7)
    pit.pass_time()
    assert ann.answer() is None

    done = operator.command("kick", "ann" if by == "name" else ann.identity.fingerprint)

    assert isinstance(done, Done)
    assert done.text.endswith(": 1 seats forfeited, 1 sent away")
    [ended] = pit.ended
    assert (ended.result.ending, ended.result.winner) == (Termination.FORFEIT, Team.RED)
    assert ended.result.reason == "blue was removed by the operator"
    assert [type(message) for message in bob.read()] == [Ended]
    assert ann.answer() == Refusal(reason="the operator sent this client away")
    assert pit.lobby().waiting == []
    assert ann.ask() is None


def test_an_entry_that_plays_itself_forfeits_one_match_once(pit: OfflinePit, operator: Player) -> None:
    ann = Player(pit, "ann")
    ann.ask(slot=0)
    ann.join(slot=1)

    assert operator.command("kick", "ann") == Done(text="ann: 2 seats forfeited, 0 sent away")
    assert len(pit.ended) == 1


@pytest.mark.parametrize("command", ["kick", "ban", "abort", "release-name"])
def test_a_target_that_is_not_here_is_refused(pit: OfflinePit, operator: Player, command: str) -> None:
    begin(pit)

    assert operator.command(command, "nobody") == Refusal(reason="nobody is not here")
    assert pit.ended == []


def test_an_entry_that_is_banned_never_comes_back_under_any_name(pit: OfflinePit, operator: Player) -> None:
    ann, _ = begin(pit)

    assert operator.command("ban", "ann") == Done(text="ann is banned; ann: 1 seats forfeited, 0 sent away")
    assert pit.ended[0].result.winner is Team.RED
    assert pit.n_saved == 1
    for name in ("ann", "other"):
        assert Player(pit, name, ann.identity).ask() == Refusal(reason="this key is banned from the pit")
    assert Player(pit, "ann").ask() is None


def test_an_entry_that_waits_or_is_known_by_name_or_key_can_be_banned(pit: OfflinePit, operator: Player) -> None:
    waiting, absent = Player(pit, "waiting"), Identity.make()
    waiting.ask()

    assert operator.command("ban", "waiting") == Done(text="waiting is banned; waiting: 0 seats forfeited, 1 sent away")
    assert operator.command("ban", "owned") == Done(text="owned is banned; it was not here")
    assert isinstance(operator.command("ban", absent.fingerprint), Done)
    assert Player(pit, "late", absent).ask() == Refusal(reason="this key is banned from the pit")
    assert waiting.ask() == Refusal(reason="this key is banned from the pit")


def test_a_pit_that_is_closed_begins_no_more_matches(pit: OfflinePit, operator: Player) -> None:
    playing = begin(pit)

    assert operator.command("close", "the pit") == Done(text="the pit begins no more matches")
    assert isinstance(Player(pit, "eve").ask(), Closed)
    assert [type(message) for message in play(*playing)] == [Ended, Ended]


def test_a_match_that_is_aborted_is_void(pit: OfflinePit, operator: Player) -> None:
    ann, bob = begin(pit)
    play(ann, bob, n_ticks=1)
    match = ann.ticket.match

    assert operator.command("abort", match) == Done(text=f"match {match} is void")
    [ended] = pit.ended
    assert (ended.result.ending, ended.result.reason) == (Termination.VOID, "was ended by the operator")
    assert operator.command("abort", match) == Refusal(reason=f"{match} is not here")
    assert Player(pit, "ann").ask() is None, "a void match gives nobody a name"


def test_a_name_that_is_released_is_free(pit: OfflinePit, operator: Player) -> None:
    assert isinstance(Player(pit, "owned").ask(), Refusal)

    assert operator.command("release-name", "owned") == Done(text="the name owned is free")
    assert Player(pit, "owned").ask() is None
