"""The player of a replay: keys and the time go in, the tick to show comes out."""

from collections.abc import Iterator

import pytest

from arena.display.player import KEYS, Player, Recording
from arena.display.scene import Scene, View
from arena.errors import ArenaError
from arena.game.types import Team

VIEWS = tuple(View(name=name, panes=("board",), teams=tuple(Team)) for name in ("blue", "red"))
EVENTS = {3, 7}


def scenes(n_ticks: int, error: str = "") -> Iterator[Scene]:
    for tick in range(n_ticks):
        yield Scene(tick=tick, title="", panes={}, units=(), is_event=tick in EVENTS)
    if error:
        raise ArenaError(error)


def player(n_ticks: int = 10, *, is_playing: bool = False, error: str = "") -> Player:
    return Player(Recording(scenes(n_ticks, error)), VIEWS, 4.0, 0.0, is_playing=is_playing)


@pytest.mark.parametrize(
    ("keys", "number"),
    [
        ("right right", 2),
        ("right right left", 1),
        ("left", 0),
        ("end", 9),
        ("end right", 9),
        ("end home", 0),
        ("n", 3),
        ("n n", 7),
        ("n n n", 9),
        ("end N", 7),
        ("end N N N", 0),
        ("v + l d u ? x", 0),
    ],
)
def test_keys_move_through_the_match(keys: str, number: int) -> None:
    shown = player()

    for key in keys.split():
        shown.press(key, 0.0)

    assert shown.number == number
    assert shown.scene is not None
    assert shown.scene.tick == number


def test_it_plays_at_its_speed_and_stops_at_the_end() -> None:
    shown = player(3, is_playing=True)

    numbers = []
    for now_s in (0.0, 0.2, 0.25, 0.3, 0.5, 0.75, 5.0):
        shown.advance(now_s)
        numbers.append(shown.number)

    assert numbers == [0, 0, 1, 1, 2, 2, 2]
    assert not shown.is_playing
    assert shown.wait_s(5.0) is None


def test_ticks_that_were_missed_are_not_rushed_through() -> None:
    shown = player(is_playing=True)

    shown.advance(100.0)
    shown.advance(100.1)

    assert shown.number == 1
    assert shown.wait_s(100.1) == pytest.approx(0.15)


def test_space_pauses_and_goes_on_and_begins_again_at_the_end() -> None:
    shown = player(is_playing=True)

    shown.press("space", 0.1)
    shown.advance(9.0)
    assert (shown.number, shown.is_playing) == (0, False)
    shown.press("space", 10.0)
    shown.advance(10.25)
    assert (shown.number, shown.is_playing) == (1, True)
    shown.press("end", 11.0)
    shown.press("space", 11.0)
    assert (shown.number, shown.is_playing) == (0, True)


def test_a_step_stops_the_film() -> None:
    shown = player(is_playing=True)

    shown.press("right", 0.0)
    shown.advance(50.0)

    assert shown.number == 1


def test_speed_has_bounds() -> None:
    shown = player()

    speeds = []
    for key in ("+", "-", *"+" * 30, *"-" * 60):
        shown.press(key, 0.0)
        speeds.append(shown.ticks_per_s)

    assert speeds[:2] == [8.0, 4.0]
    assert (max(speeds), min(speeds)) == (1000.0, 0.1)


def test_what_is_shown_is_switched() -> None:
    shown = player()

    before = [shown.view.name, shown.has_numbers, shown.shows_log, shown.shows_drawings, shown.shows_keys]
    for key in "vuld?":
        shown.press(key, 0.0)

    assert before == ["blue", True, True, True, False]
    assert [shown.view.name, shown.has_numbers, shown.shows_log, shown.shows_drawings, shown.shows_keys] == [
        "red", False, False, False, True,
    ]  # fmt: skip
    shown.press("v", 0.0)
    shown.press("q", 0.0)
    assert (shown.view.name, shown.is_over) == ("blue", True)


def test_a_match_is_played_no_further_than_somebody_looked() -> None:
    given: list[int] = []

    def watched() -> Iterator[Scene]:
        for scene in scenes(10):
            given.append(scene.tick)
            yield scene

    shown = Player(Recording(watched()), VIEWS, 4.0, 0.0, is_playing=False)
    for key in ("right", "right", "left", "left", "right"):
        shown.press(key, 0.0)

    assert (given, shown.number, shown.last) == ([0, 1, 2], 1, None)
    shown.press("end", 0.0)
    assert (len(given), shown.last) == (10, 9)


def test_a_match_that_breaks_off_is_shown_up_to_there() -> None:
    recording = Recording(scenes(3, "it breaks off"), last=9)
    shown = Player(recording, VIEWS, 4.0, 0.0, is_playing=False)

    assert (shown.last, recording.error) == (9, None)
    shown.press("end", 0.0)

    assert (shown.number, shown.last, str(recording.error)) == (2, 2, "it breaks off")


def test_a_match_without_ticks_shows_nothing() -> None:
    shown = player(0)

    for key in ("right", "end", "n", "space"):
        shown.press(key, 0.0)
    shown.advance(9.0)

    assert (shown.scene, shown.number) == (None, 0)


def test_every_key_is_in_the_list_of_keys() -> None:
    named = " ".join(keys for keys, _ in KEYS).replace(",", "").split()

    assert set(named) == {*"nNvuldm?q+-", "space", "right", "left", "home", "end", "down", "up"}
