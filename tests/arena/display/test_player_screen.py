"""The screen of the player, on terminals of any size."""

from collections.abc import Iterator

import numpy as np
import pytest
from rich.console import Console

from arena.display.player import Player, Recording
from arena.display.player_screen import draw_player
from arena.display.scene import Pane, Scene, UnitLine, View
from arena.game.types import Code, Team

SEEN, TRUTH = "what blue sees", "the truth"
VIEW = View(name="blue", panes=(SEEN, TRUTH), teams=(Team.BLUE,))
ALONE = View(name="truth", panes=(TRUTH,), teams=tuple(Team))


def scene(side: int = 20, **changes: object) -> Scene:
    grid = np.full((side, side), Code.BLUE_HALF, np.int8)
    grid[:, side // 2 :] = Code.RED_HALF
    grid[0, 0], grid[0, 1], grid[side - 1, 2], grid[1, 5] = Code.BLUE_UGV, Code.BLUE_UAV, Code.RED_UGV, Code.HIDDEN
    pane = Pane(grid=grid, numbers={(0, 0): 2, (0, 1): 4}, is_drawn_on=True)
    units = [UnitLine(team=Team.BLUE, name=f"ugv {number}", order="north") for number in range(4)]
    units += [
        UnitLine(team=Team.BLUE, name="uav 4", order="fallen", fate="fell"),
        UnitLine(team=Team.RED, name="ugv 0", order="west"),
    ]
    given = {"panes": {SEEN: pane, TRUTH: Pane(grid=grid, numbers={})}, "units": tuple(units), **changes}
    return Scene(tick=0, title="blue a against red b   tick 0 of 100", **given)  # type: ignore[arg-type]


def open_player(shown: Scene, *views: View) -> Player:
    def scenes() -> Iterator[Scene]:
        yield shown

    return Player(Recording(scenes()), views or (VIEW,), 8.0, 0.0, is_playing=False)


def draw(player: Player, width: int = 80, height: int = 24, *, colours: bool = False) -> list[str]:
    console = Console(width=width, height=height, force_terminal=colours, color_system="truecolor" if colours else None)
    with console.capture() as capture:
        console.print(draw_player(player, width, height))
    return capture.get().splitlines()


@pytest.mark.parametrize("side", [6, 20, 32])
@pytest.mark.parametrize(("width", "height"), [(80, 24), (43, 10), (20, 5), (200, 60)])
def test_it_fits_every_screen(side: int, width: int, height: int) -> None:
    notes = {"log": ["a long line " * 20] * 9, "drawings": [{"cell": [0, 3], "colour": "red", "text": "abc"}]}

    lines = draw(open_player(scene(side, **notes)), width, height)

    assert len(lines) <= height
    assert max(map(len, lines)) <= width


def test_orders_and_the_legend_stand_beside_two_boards_on_80_columns_and_24_rows() -> None:
    lines = draw(open_player(scene()))

    assert lines[1].split() == ["what", "blue", "sees", "the", "truth", "orders"]
    assert lines[2][46:].rstrip() == "ugv 0  north"
    assert lines[6][46:].rstrip() == "uav 4  fallen  fell"
    assert "west" not in "".join(lines)
    assert any("UGV UAV flag half" in line for line in lines)
    assert lines[-1].startswith("paused  tick 0 of ")


def test_units_have_their_numbers() -> None:
    player = open_player(scene(), ALONE, VIEW)
    player.press("v", 0.0)

    narrow, wide = draw(player)[2], draw(player, 130)[2]
    player.press("u", 0.0)
    letters = draw(player)[2]

    assert (narrow[:3], wide[:6], letters[:3]) == ("24·", "U2A4· ", "UA·")
    assert draw(player)[21][2] == "u"


def test_a_higher_board_is_scrolled() -> None:
    player = open_player(scene(32))

    top = draw(player)
    for _ in range(50):
        player.press("down", 0.0)
    bottom = draw(player)
    player.press("up", 0.0)

    assert (top[2][0], bottom[-2][2]) == ("2", "u")
    assert (player.first_row, draw(player)[-2][2]) == (10, "·")
    assert "the truth: press v" in top[1]


def test_the_keys_are_explained() -> None:
    player = open_player(scene())
    player.press("?", 0.0)

    assert any("the next fight, fall or capture" in line for line in draw(player))


def test_fights_falls_and_captures_are_coloured_where_the_board_shows_the_cell() -> None:
    places = {"fought": frozenset({(0, 0), (1, 5)}), "fell": frozenset({(3, 3)}), "graves": frozenset({(3, 3), (4, 4), (0, 1)})}
    player = open_player(scene(6, **places))

    lines = draw(player, colours=True)
    plain = draw(player)

    fight, fall = "48;2;163;33;122", "48;2;198;40;40"
    assert "".join(lines).count(fight) == 2 + 1  # on two boards, and in the legend
    assert "".join(lines).count(fall) == 2 + 1 + 1  # and beside the unit
    assert (plain[5][6], plain[6][8], plain[2][:4]) == ("x", "x", "U2A4")


def test_the_log_stands_beside_the_boards_or_below_them_and_is_switched_off() -> None:
    player = open_player(scene(log=("flag at (3, 4)", "raw \x1b[2J")))

    beside, below = draw(player), draw(player, 80, 40)
    player.press("l", 0.0)

    assert any(line[46:].startswith("flag at (3, 4)") for line in beside)
    assert "flag at (3, 4)" in below[22:]
    assert r"raw \x1b[2J" in below
    assert not any("flag at" in line for line in draw(player))


def test_a_log_that_is_too_long_says_how_much_is_left_out() -> None:
    lines = draw(open_player(scene(log=tuple(f"line {number}" for number in range(40)))))

    assert lines[-2][46:].startswith("... ")
    assert len(lines) == 24


def test_drawings_stand_on_what_the_fighter_saw_alone_and_are_switched_off() -> None:
    drawings = [
        {"heat": bytes([255, 0, 255] + [0] * 33), "colour": "blue"},
        {"cell": [2, 3], "colour": "yellow", "text": "go"},
        {"path": [[3, 0], [3, 1], [0, 0]], "colour": "red"},
    ]
    player = open_player(scene(6, drawings=drawings))

    drawn, colours = draw(player), "".join(draw(player, colours=True))
    player.press("d", 0.0)

    assert (drawn[4][6:8], drawn[5][:4], drawn[2][:2]) == ("go", "• • ", "U2")
    assert (drawn[4].count("go"), colours.count("48;2;249;168;37"), colours.count("48;2;21;101;192")) == (1, 1, 1)
    assert "•" not in "".join(draw(player))


def test_a_heat_map_is_chosen_by_its_label_and_of_all_the_strongest_colours_a_cell() -> None:
    """Red lies strongly on the first cell of row 2, blue weakly there and strongly beside it."""
    heats = {"red": bytes([0] * 12 + [255, 64] + [0] * 22), "blue": bytes([0] * 12 + [64, 255] + [0] * 22)}
    drawings = [{"heat": heat, "colour": colour, "label": f"in {colour}"} for colour, heat in heats.items()]
    player = open_player(scene(6, drawings=drawings))
    strong_red, strong_blue = "48;2;198;40;40m· ", "48;2;21;101;192m· "

    def look() -> tuple[bool, bool, str]:
        lines = draw(player, colours=True)
        return strong_red in lines[4], strong_blue in lines[4], lines[-1].partition("  map ")[2].partition("  ")[0]

    shown = [look()]
    for _ in range(3):
        player.press("m", 0.0)
        shown.append(look())

    assert shown == [(True, True, ""), (True, False, "in red"), (False, True, "in blue"), (True, True, "")]
