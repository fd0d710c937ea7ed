"""The last gauntlets of a bot, kept in the data folder, and what has changed between two of them beyond noise.

    gauntlets/NAME-KEY/run-0007/result.json     what was scored, pair by pair
    gauntlets/NAME-KEY/run-0007/journals/       its matches

KEY stands for the bot's path, the rules and the seed, so that all runs of a folder are played on the same maps. Two runs are
compared pair by pair: had nothing but luck changed, each difference would be as likely with the other sign. The chance of a sum
that far from 0 is computed exactly, over all signs; over the opponents together, 5% of comparisons may call a change what is none
(Holm, 1979).
"""

import json
import shutil
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from hashlib import sha256
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np

from arena.errors import InputError
from arena.files import read_text
from tournaments.ratings.sprt import PAIR_SCORES

MOST_RUNS = 20
_LEVEL = 0.05
_RESULT = "result.json"
_FORMAT = 1


@dataclass(frozen=True, slots=True, kw_only=True)
class Change:
    """What has changed against one opponent, or against all of them."""

    score_before: float
    """Of the pairs that both runs have."""
    score: float
    n_pairs: int
    p_value: float
    """How likely luck alone brings a difference of this size."""
    verdict: str
    """better, worse, or same: no more than noise."""

    def to_dict(self) -> dict[str, Any]:
        """Return what programs are told."""
        return asdict(self)


@dataclass(frozen=True, slots=True, kw_only=True)
class Comparison:
    """Two runs of one bot."""

    run: str
    """The earlier one."""
    is_same_file: bool
    """Whether the bot's file was then what it is now; of a program only its command is known."""
    opponents: Mapping[str, Change]
    """Those who were met in both runs."""
    overall: Change


class Runs:
    """The runs of one bot under the same rules and seed.

    Raises
    ------
    InputError
        The folder cannot be made.
    """

    def __init__(self, data: Path, name: str, *setting: str) -> None:
        key = sha256("\0".join(setting).encode("utf-8", "surrogateescape")).hexdigest()[:10]
        safe = "".join(letter if letter.isalnum() or letter in "-_" else "_" for letter in name)[:40]
        self.folder = data / "gauntlets" / f"{safe}-{key}"

    def begin(self) -> Path:
        """Make the folder of a new run, and forget the oldest beyond `MOST_RUNS`."""
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            last = max((int(run.name.removeprefix("run-")) for run in self._all()), default=0)
            for number in count(last + 1):
                run = self.folder / f"run-{number:04}"
                try:
                    run.mkdir()
                except FileExistsError:
                    continue  # another gauntlet of the same bot has begun
                break
            for old in self._all()[:-MOST_RUNS]:
                shutil.rmtree(old)
        except OSError as error:
            raise InputError(f"cannot keep gauntlets in {self.folder}: {error.strerror}") from error
        return run

    def last(self) -> tuple[str, dict[str, Any]] | None:
        """Return the name of the last run that was finished and can be read, and what was kept of it."""
        for run in reversed(self._all()):
            try:
                kept = json.loads(read_text(run / _RESULT))
            except (OSError, ValueError):  # it was stopped, or changed
                continue
            if _is_readable(kept):
                return run.name, kept
        return None

    def keep(self, run: Path, fingerprint: str, pairs: Mapping[str, Sequence[float]]) -> None:
        """Keep what was scored in each pair against each opponent."""
        kept = {"format": _FORMAT, "fingerprint": fingerprint, "pairs": {name: list(scores) for name, scores in pairs.items()}}
        draft = run / f".{_RESULT}"
        try:
            draft.write_text(json.dumps(kept), encoding="utf-8")
            draft.replace(run / _RESULT)
        except OSError as error:
            raise InputError(f"cannot keep the result in {run}: {error.strerror}") from error

    def _all(self) -> list[Path]:
        found = (run for run in self.folder.glob("run-*") if run.name.removeprefix("run-").isdecimal())
        return sorted(found, key=lambda run: int(run.name.removeprefix("run-")))


def compare(run: str, kept: Mapping[str, Any], fingerprint: str, pairs: Mapping[str, Sequence[float]]) -> Comparison | None:
    """Return what has changed since a kept run; None if it has met none of these opponents."""
    before: Mapping[str, Sequence[float]] = kept["pairs"]
    both = {name: list(zip(before[name], scores, strict=False)) for name, scores in pairs.items() if name in before}
    if not both:
        return None
    p_values = {name: sign_flip_p_value([now - then for then, now in scores]) for name, scores in both.items()}
    significant = _holm(p_values)
    together = [pair for scores in both.values() for pair in scores]
    p_value = sign_flip_p_value([now - then for then, now in together])
    return Comparison(
        run=run,
        is_same_file=kept.get("fingerprint") == fingerprint,
        opponents={name: _change(scores, p_values[name], name in significant) for name, scores in both.items()},
        overall=_change(together, p_value, p_value < _LEVEL),
    )


def _is_readable(kept: Any) -> bool:
    if not isinstance(kept, dict) or kept.get("format") != _FORMAT or not isinstance(kept.get("pairs"), dict):
        return False
    return all(
        isinstance(scores, list) and scores and all(one in PAIR_SCORES for one in scores) for scores in kept["pairs"].values()
    )


def sign_flip_p_value(differences: Sequence[float]) -> float:
    """Return how likely random signs bring a sum of differences at least as far from 0; they are multiples of a half.

    Examples
    --------
    >>> sign_flip_p_value([1, 1, 1, 1, 0.5])
    0.0625
    >>> sign_flip_p_value([0, 0, 1, -1])
    1.0
    """
    steps = [round(2 * abs(one)) for one in differences]
    ways = np.ones(1)  # over the sums from -reach to reach
    for step in steps:
        wider = np.zeros(len(ways) + 2 * step)
        wider[: len(ways)] += ways / 2
        wider[2 * step :] += ways / 2
        ways = wider
    reach, found = sum(steps), abs(round(2 * sum(differences)))
    sums = np.abs(np.arange(-reach, reach + 1))
    return float(min(ways[sums >= found].sum(), 1.0))


def _holm(p_values: Mapping[str, float]) -> set[str]:
    """Return those that are significant together: from the smallest on, each is held against its share of the level."""
    found: set[str] = set()
    for rank, (name, p_value) in enumerate(sorted(p_values.items(), key=lambda item: item[1])):
        if p_value >= _LEVEL / (len(p_values) - rank):
            break
        found.add(name)
    return found


def _change(scores: Sequence[tuple[float, float]], p_value: float, is_significant: bool) -> Change:
    before, now = (sum(one) / (2 * len(scores)) for one in zip(*scores, strict=True))
    verdict = "same" if not is_significant else "better" if now > before else "worse"
    return Change(
        score_before=round(before, 4), score=round(now, 4), n_pairs=len(scores), p_value=round(p_value, 6), verdict=verdict
    )
