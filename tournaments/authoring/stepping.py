"""One match in this process, played tick by tick as somebody looks at it: `arena play --step`."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
from rich.console import Console

from arena.annotations import read_annotations
from arena.console import quantity, say, say_lines
from arena.display.player import Recording
from arena.display.scene import Scene, pane_of, scene_of_game, views_of_journal
from arena.display.terminal_replay import has_keys, play_with_keys
from arena.errors import InputError
from arena.game.ruleset import Ruleset
from arena.game.types import Team
from arena.local.saving import make_journals_folder, save
from arena.local.venue import Batch, Load, MatchRecord
from arena.records.journal import Mark
from arena.records.plan import MatchPlan
from tournaments.authoring.captured_output import captured_output

_TICKS_PER_S = 4.0
TakePrinted = Callable[[], list[str]]
"""Returns the lines that were printed since it was called last."""


class SteppedPlay:
    """A match that is played no further than its scenes are asked for; what one seat notes and prints is kept with them."""

    def __init__(self, ruleset: Ruleset, plan: MatchPlan, load: Load, team: Team, take_printed: TakePrinted) -> None:
        self.record: MatchRecord | None = None
        """Once the match is over."""
        self._plan, self._team, self._take_printed = plan, team, take_printed
        self._batch = Batch(ruleset, 1, load(plan.blue), load(plan.red))
        fighter = self._batch.fighters[team]
        fighter.keeps_annotations = fighter.explains = True

    def scenes(self) -> Iterator[Scene]:
        """Yield every tick with what is ordered then, and how the board lies at the end; it can be called once."""
        batch = self._batch
        batch.start([0], [self._plan])
        while self.record is None:
            batch.ask()
            yield self._scene(batch.orders)
            for _, record in batch.step():
                self.record = record
        yield self._scene(None)

    def _scene(self, orders: dict[Team, np.ndarray] | None) -> Scene:
        names, printed = (self._plan.blue, self._plan.red), tuple(f"printed: {line}" for line in self._take_printed())
        if orders is None:
            return replace(scene_of_game(self._batch.games, names), log=printed)
        told = np.maximum(np.concatenate([orders[team][0] for team in Team]), 0).tobytes()
        marks = [Mark.UNREADABLE if (orders[team][0] < 0).any() else Mark(0) for team in Team]
        scene = scene_of_game(self._batch.games, names, told, marks)
        notes = read_annotations(self._batch.fighters[self._team].take_annotations(0), self._batch.games.ruleset.side)
        own = pane_of(self._team)
        panes = {**scene.panes, own: replace(scene.panes[own], is_drawn_on=True)}
        return replace(scene, panes=panes, log=(*notes["log"], *printed), drawings=notes["draw"])


def step_through(ruleset: Ruleset, plan: MatchPlan, load: Load, team: Team, *, journals: Path | None) -> None:
    """Play a match on a terminal, seen from a team; then say how it ended, and what went wrong.

    Raises
    ------
    InputError
        There is no terminal, or the journal cannot be written.
    """
    if not has_keys(Console()):
        raise InputError("--step wants a terminal; leave it out, or keep --journals and look at them with `arena replay show`")
    if journals is not None:
        make_journals_folder(journals)
    with captured_output() as kept:
        match = SteppedPlay(ruleset, plan, load, team, kept.take)
        recording = Recording(match.scenes())
        play_with_keys(Console(file=kept.terminal), recording, views_of_journal(team), _TICKS_PER_S, is_playing=False)
        rest = kept.take()
    if rest:
        say(*rest, err=True)
    if match.record is None:
        say(f"left at tick {len(recording) - 1}: the match is not over")
        return
    for record in [match.record] if journals is None else save(iter([match.record]), journals):
        say(f"blue {plan.blue} against red {plan.red}: {record.result.describe()}")
        for name, faults in zip((plan.blue, plan.red), record.faults, strict=True):
            for sentence, n_turns in faults.reasons.values():
                say(f"{name}: {sentence} ({quantity(n_turns, 'turn')})")
            if faults.first_traceback:
                say("", f"{name} first failed like this:", err=True)
                say_lines(faults.first_traceback, err=True)
