"""What the settings of all samples have in common that are gathered from matches."""

from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass
from typing import Any, Self

from arena.game.ruleset import Ruleset, load, parse_overrides
from policies.registry import load as load_fighter
from policies.training.opponents import SELF, check_learner
from policies.training.settings import MOST_SEED, check_range, check_shares, merge_shares, read_values


@dataclass(frozen=True, slots=True, kw_only=True)
class GatherSettings:
    """Which matches are played, and by whom."""

    student: str = ""
    """A checkpoint's file, or a shipped network's name; or nothing."""
    rules: str = "paper"
    seed: int = 1
    games: int = 24
    """Matches that a process plays at once."""
    file_samples: int
    """Samples from which on a file is written."""
    opponents: dict[str, float]
    """Share of the matches against each."""

    def check(self) -> None:
        """Refuse values by which no matches can be played; `InputError` says which."""
        check_range(self, "seed", 0, MOST_SEED)
        check_range(self, "games", 1, 10**6)
        check_range(self, "file_samples", 1, 10**9)
        check_shares("opponents", self.opponents)

    def with_(self, assignments: Iterable[str]) -> Self:
        """Return a copy with values such as "games=8" or "opponents.rush=0.5" replaced."""
        new: Mapping[str, Any] = parse_overrides(assignments)
        if "opponents" in new:
            new = {**new, "opponents": merge_shares("opponents", self.opponents, new["opponents"])}
        return read_values(type(self), {**asdict(self), **new})

    def load_rules(self) -> Ruleset:
        """Return the ruleset, if there is somebody to learn from, and the opponents are there.

        Raises
        ------
        InputError
            Blue has no units, one network cannot play both teams, or somebody is not there.
        """
        ruleset = load(self.rules)
        check_learner(ruleset, self.opponents)
        for name in self.opponents:
            if name != SELF:
                load_fighter(name)
        return ruleset
