"""What a person commands in one seat, as data: selection, standing orders, autopilot, remembered ground.

Pure: observations, keys and clicks go in with the time, actions and a `ViewModel` come out. The terminal and the browser are two
shells around it.
"""

from collections.abc import Sequence

import numpy as np

from arena.game.observation import Observation, OwnUnit
from arena.game.rules import can_enter, reach_of
from arena.game.ruleset import Ruleset
from arena.game.types import Action, Code, Team
from clients.human.routes import Cell, Routes, lead
from clients.human.view_model import Option, UnitView, ViewModel


class Commander:
    """Commands the units of one seat in one match, from the first `see` on."""

    def __init__(self, ruleset: Ruleset, team: Team) -> None:
        self.ruleset, self.team = ruleset, team
        self.selected = -1
        self._kinds = ruleset.team(team)
        self._known = np.full((ruleset.side, ruleset.side), Code.HIDDEN, np.int8)
        self._routes = Routes(ruleset.side)
        self._orders: dict[int, Action | Cell] = {}
        """Standing orders by unit: a direction, or a cell to go to."""
        self._fresh: set[int] = set()
        self._seen: Observation | None = None
        self._advice: Sequence[int] | None = None
        self._deadline_s: float | None = None

    @property
    def tick(self) -> int:
        """The tick to be answered; -1 before the first."""
        return -1 if self._seen is None else self._seen.tick

    @property
    def is_complete(self) -> bool:
        """Whether every living unit got its order in this turn."""
        return self._seen is not None and all(unit.index in self._fresh for unit in self._living())

    def see(self, seen: Observation, advice: Sequence[int] | None, deadline_s: float | None) -> None:
        """Begin a turn.

        Parameters
        ----------
        advice
            What the autopilot would do, an action per unit; None without one.
        deadline_s
            When the turn ends by itself, on the clock of `view_model`; None where no clock runs.
        """
        self._seen, self._advice, self._deadline_s = seen, advice, deadline_s
        self._fresh.clear()
        self._known = np.where(seen.ground == Code.HIDDEN, self._known, seen.ground)
        self._routes.learn(self._known)
        for unit in seen.units:
            if not unit.alive:
                self._orders.pop(unit.index, None)
        if not self._can_command(self.selected):
            self.selected = -1
            self.select_next()

    def extend(self, deadline_s: float | None) -> None:
        """End the current turn later, after the pit was away."""
        self._deadline_s = deadline_s

    def advise(self, advice: Sequence[int] | None) -> None:
        """Replace the actions of units without orders in this turn; None lets them stay."""
        self._advice = advice

    def select(self, index: int) -> bool:
        """Select a unit; False, and nothing changes, if it has fallen or there is none."""
        if not self._can_command(index):
            return False
        self.selected = index
        return True

    def select_next(self, step: int = 1) -> None:
        """Select the next living unit, or with `step` = -1 the one before."""
        living = [unit.index for unit in self._living()]
        if self.selected in living:
            self.selected = living[(living.index(self.selected) + step) % len(living)]
        elif living:
            self.selected = living[0]

    def order(self, action: Action) -> bool:
        """Order the selected unit to go in a direction, or to stay, until its next order; False if it cannot."""
        option = next((one for one in self._options() if one.action is action), None)
        if option is None or not option.is_open:
            return False
        self._set_order(action)
        return True

    def send(self, row: int, column: int) -> bool:
        """Order the selected unit to go to a cell and stay there; False if no way is known."""
        if self.selected < 0 or not (0 <= row < self.ruleset.side and 0 <= column < self.ruleset.side):
            return False
        unit = self._unit(self.selected)
        if (row, column) != (unit.row, unit.column) and not self._way(unit, (row, column))[0]:
            return False
        self._set_order((row, column))
        return True

    def point(self, row: int, column: int) -> bool:
        """Take a click: on an own unit it selects, of several in a cell the next; elsewhere it sends the selected unit."""
        here = [unit.index for unit in self._living() if (unit.row, unit.column) == (row, column)]
        if not here:
            return self.send(row, column)
        later = [index for index in here if index > self.selected]
        self.selected = later[0] if self.selected in here and later else here[0]
        return True

    def release(self) -> None:
        """Cancel the selected unit's order: the autopilot moves it, or nobody."""
        self._orders.pop(self.selected, None)
        self._fresh.discard(self.selected)

    def actions(self) -> list[Action]:
        """Return what the units do if the turn ends now, one action each."""
        return [] if self._seen is None else [self._action(unit) for unit in self._seen.units]

    def view_model(self, now_s: float) -> ViewModel:
        """Return what a screen shows now; `ValueError` before the first turn."""
        seen = self._seen
        if seen is None:
            raise ValueError("there was no observation yet")
        grid = seen.grid
        return ViewModel(
            tick=seen.tick,
            tick_limit=self.ruleset.tick_limit,
            team=self.team,
            score=seen.score,
            living=seen.living,
            time_left_s=None if self._deadline_s is None else max(self._deadline_s - now_s, 0.0),
            grid=grid,
            known=np.where(grid == Code.HIDDEN, self._known, grid),
            units=tuple(map(self._draw, seen.units)),
            selected=self.selected,
            options=self._options(),
            is_complete=self.is_complete,
        )

    def _draw(self, unit: OwnUnit) -> UnitView:
        order, kind = self._orders.get(unit.index), self._kinds[unit.index]
        target = order if isinstance(order, tuple) else None
        is_autopilot = unit.alive and order is None and self._advice is not None
        return UnitView(
            index=unit.index, type=unit.type, cell=(unit.row, unit.column), alive=unit.alive, flies=unit.flies,
            sight=kind.sight, attack=kind.attack, reach=reach_of(kind.attack, self.ruleset.attack_at_range, kind.flies),
            order=self._describe(unit), action=self._action(unit), target=target,
            route=() if target is None else tuple(self._way(unit, target)[1]), is_fresh=unit.index in self._fresh,
            is_autopilot=is_autopilot,
        )  # fmt: skip

    def _describe(self, unit: OwnUnit) -> str:
        order = self._orders.get(unit.index)
        if not unit.alive:
            return "fallen"
        if order is None:
            return "no order" if self._advice is None else "autopilot"
        if isinstance(order, Action):
            return order.name.lower()
        if order == (unit.row, unit.column):
            return "is there, stays"
        return f"to {order[0]},{order[1]}" if self._way(unit, order)[0] else f"no way to {order[0]},{order[1]}"

    def _action(self, unit: OwnUnit) -> Action:
        order = self._orders.get(unit.index)
        if not unit.alive:
            return Action.STAY
        if order is None:
            return Action.STAY if self._advice is None else Action(self._advice[unit.index])
        if isinstance(order, Action):
            return order
        return next(iter(self._way(unit, order)[0]), Action.STAY)

    def _way(self, unit: OwnUnit, goal: Cell) -> tuple[list[Action], list[Cell]]:
        """Return the way of a unit: around others of its team that stay, and through them where there is no other."""
        kind, at = self._kinds[unit.index], (unit.row, unit.column)
        others = [one for one in self._living() if not one.flies and one.index != unit.index]
        around = self._routes.find(kind, at, goal, tuple((one.row, one.column) for one in others if self._stays(one)))
        return around if around[0] else self._routes.find(kind, at, goal, ())

    def _stays(self, unit: OwnUnit) -> bool:
        order = self._orders.get(unit.index)
        if order is None:
            return self._advice is None or self._advice[unit.index] == Action.STAY
        return order in (Action.STAY, (unit.row, unit.column))

    def _options(self) -> tuple[Option, ...]:
        if self.selected < 0:
            return ()
        unit, side = self._unit(self.selected), self.ruleset.side
        at, step = (unit.row, unit.column), self._kinds[unit.index].step
        options = [Option(action=Action.STAY, to=at, is_open=True)]
        for action in list(Action)[1:]:
            to, why = lead(at, action, step, side), ""
            if to == at:
                why = "the board ends" if step else "it cannot move"
            elif not can_enter(self._known[to], unit.flies):
                why = "an obstacle"
            options.append(Option(action=action, to=to, is_open=not why, why=why))
        return tuple(options)

    def _set_order(self, order: Action | Cell) -> None:
        self._orders[self.selected] = order
        self._fresh.add(self.selected)

    def _living(self) -> list[OwnUnit]:
        return [] if self._seen is None else [unit for unit in self._seen.units if unit.alive]

    def _can_command(self, index: int) -> bool:
        return any(unit.index == index for unit in self._living())

    def _unit(self, index: int) -> OwnUnit:
        assert self._seen is not None
        return self._seen.units[index]
