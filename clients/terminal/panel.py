"""What stands beside the board, as text: whose turn it is, what each unit does, and what the chosen one may do."""

from collections.abc import Sequence

from rich.text import Text

from arena.display.text import tell_end
from arena.game.observation import Observation
from arena.game.types import Action, Team
from arena.policy import MatchResult
from clients.human.view_model import Picture, UnitPicture
from clients.terminal.board import ARROWS

HELP = (
    "0-9 Tab click: a unit  arrows WASD: direct it  click: go there  space: stay\n"
    "Enter: end turn  x: take the order back  p: autopilot  m: memory  q: leave"
)
"""Stands on the screen always: a newcomer reads nothing else."""
_HURRY_S = 5.0


def tell_turn(picture: Picture, opponent: str, *, is_my_turn: bool) -> Text:
    """Return the facts of the turn, the time left among them."""
    if not is_my_turn:
        text = Text(f"waiting for {opponent}", "italic")
    elif picture.time_left_s is None:
        text = Text("your turn, no clock", "bold")
    else:
        text = Text(f"{picture.time_left_s:.0f} s left", "bold reverse" if picture.time_left_s < _HURRY_S else "bold")
    own, enemy = picture.living
    return text.append(
        f"   tick {picture.tick} of {picture.tick_limit}   score {picture.score:+d}   units {own}:{enemy}", "not bold not reverse"
    )


def tell_goal(team: Team, opponent: str) -> Text:
    """Return what to do, in a line or two."""
    own, flag, enemy_flag = ("blue", "F", "f") if team is Team.BLUE else ("red", "f", "F")
    return Text(
        f"You are {own} against {opponent}. Find their flag {enemy_flag} and walk a unit onto it; they are after yours, {flag}."
    )


def tell_units(picture: Picture, autopilot: str) -> Text:
    """Return a line for each own unit: its number, kind and place, what it was told, and what it does now."""
    text = Text("unit    at     does\n", "bold")
    for unit in picture.units:
        style = "dim" if not unit.alive else "reverse" if unit.index == picture.selected else ""
        text.append(_tell_unit(unit, autopilot), style).append("\n")
    text.rstrip()
    return text


def _tell_unit(unit: UnitPicture, autopilot: str) -> str:
    name = f"{unit.index} {unit.type}"
    if not unit.alive:
        return f"{name:7} fallen"
    order = autopilot if unit.is_autopilot else unit.order
    return f"{name:7} {unit.cell[0]:2},{unit.cell[1]:<3} {ARROWS[unit.action]} {order}{' *' if unit.is_fresh else ''}"


def tell_options(picture: Picture) -> Text:
    """Return what the chosen unit may do, and why it may not do the rest."""
    if picture.selected < 0:
        return Text("none of your units lives")
    unit = picture.units[picture.selected]
    text = Text(f"unit {unit.index} ({unit.type}) sees {unit.sight} cells{_tell_attack(unit)} and may go\n")
    for option in picture.options:
        if option.action is Action.STAY:
            continue
        where = option.why or f"to {option.to[0]},{option.to[1]}"
        text.append(f"  {ARROWS[option.action]} {option.action.name.lower():5} {where}\n", "" if option.is_open else "dim strike")
    text.rstrip()
    return text


def _tell_attack(unit: UnitPicture) -> str:
    return f", fights within {unit.attack}" if unit.attack else ", flies, cannot capture" if unit.flies else ""


def tell_over(team: Team, result: MatchResult, seen: Sequence[Observation]) -> Text:
    """Return how the match ended, and why."""
    text = Text(result.describe(team).capitalize() + "\n\n", "bold")
    text.append(tell_end(seen, result).capitalize() + ".\n")
    return text
