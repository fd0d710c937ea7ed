"""What stands beside the board, as text: whose turn it is, what each unit does, and what the selected one may do."""

from collections.abc import Sequence

from rich.text import Text

from arena.console import clean
from arena.display.words import format_last_tick
from arena.game.observation import Observation
from arena.game.types import Action, Team
from arena.policy import MatchResult
from clients.human.view_model import UnitView, ViewModel
from clients.terminal.board import ARROWS

HELP = (
    "0-9 Tab click: a unit  arrows WASD: direct it  click: go there  space: stay\n"
    "Enter: end turn  x: take the order back  p: autopilot  m: memory  q: leave"
)
"""Always on the screen: a newcomer reads nothing else."""
_HURRY_S = 5.0


def format_turn(view: ViewModel, opponent: str, *, is_my_turn: bool) -> Text:
    """Return the facts of the turn, the time left among them."""
    if not is_my_turn:
        text = Text(f"waiting for {opponent}", "italic")
    elif view.time_left_s is None:
        text = Text("your turn, no clock", "bold")
    else:
        text = Text(f"{view.time_left_s:.0f} s left", "bold reverse" if view.time_left_s < _HURRY_S else "bold")
    own, enemy = view.living
    return text.append(
        f"   tick {view.tick} of {view.tick_limit}   score {view.score:+d}   units {own}:{enemy}", "not bold not reverse"
    )


def format_goal(team: Team, opponent: str) -> Text:
    """Return what to do, in a line or two."""
    own, flag, enemy_flag = ("blue", "F", "f") if team is Team.BLUE else ("red", "f", "F")
    return Text(
        f"You are {own} against {opponent}. Find their flag {enemy_flag} and walk a unit onto it; they are after yours, {flag}."
    )


def format_units(view: ViewModel, autopilot: str) -> Text:
    """Return a line for each own unit: its number, kind, place, order, and what it does now."""
    text = Text("unit    at     does\n", "bold")
    for unit in view.units:
        style = "dim" if not unit.alive else "reverse" if unit.index == view.selected else ""
        text.append(_format_unit(unit, autopilot), style).append("\n")
    text.rstrip()
    return text


def _format_unit(unit: UnitView, autopilot: str) -> str:
    name = f"{unit.index} {unit.type}"
    if not unit.alive:
        return f"{name:7} fallen"
    order = autopilot if unit.is_autopilot else unit.order
    return f"{name:7} {unit.cell[0]:2},{unit.cell[1]:<3} {ARROWS[unit.action]} {order}{' *' if unit.is_fresh else ''}"


def format_options(view: ViewModel) -> Text:
    """Return what the selected unit may do, and why it may not do the rest."""
    if view.selected < 0:
        return Text("none of your units lives")
    unit = view.units[view.selected]
    text = Text(f"unit {unit.index} ({unit.type}) sees {unit.sight} cells{_format_attack(unit)} and may go\n")
    for option in view.options:
        if option.action is Action.STAY:
            continue
        where = option.why or f"to {option.to[0]},{option.to[1]}"
        text.append(f"  {ARROWS[option.action]} {option.action.name.lower():5} {where}\n", "" if option.is_open else "dim strike")
    text.rstrip()
    return text


def _format_attack(unit: UnitView) -> str:
    return f", fights within {unit.attack}" if unit.attack else ", flies, cannot capture" if unit.flies else ""


def format_ending(team: Team, result: MatchResult, seen: Sequence[Observation]) -> Text:
    """Return how the match ended, and why."""
    text = Text(clean(result.describe(team).capitalize()) + "\n\n", "bold")
    text.append(clean(format_last_tick(seen, result).capitalize()) + ".\n")
    return text
