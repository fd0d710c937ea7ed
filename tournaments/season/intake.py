"""What was submitted, checked one after another behind a wall, as `arena check` does: what passes becomes a version.

A process that is killed meanwhile leaves the submission waiting. What a bot does in its check ends with its processes.
"""

import logging
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from threading import Event, Thread
from typing import Any

from arena.console import clean
from arena.errors import InputError
from arena.game.ruleset import Ruleset
from arena.match.time_control import TimeControl
from arena.sandbox.limits import BEHIND_A_WALL, Limits
from arena.sandbox.process import Sandbox
from policies.workers.files import fighter_in
from tournaments.authoring.check import OPPONENTS, check
from tournaments.authoring.findings import Report
from tournaments.season.submitted import SubmittedFolder
from tournaments.store.schema import StoreError
from tournaments.store.season_store import WAITING, SeasonStore, Submission, WithdrawnError
from tournaments.store.store import StoredLeague

logger = logging.getLogger(__name__)
_LOOK_S = 1.0
_MOST_FINDINGS, _MOST_LETTERS = 12, 300
"""Of a report, which fits one message of the protocol."""
_ACCEPTED = "it was accepted, and plays from now on"


@dataclass(frozen=True, slots=True, kw_only=True)
class CheckTerms:
    """How submissions are checked: under the season's own clock and limits."""

    ruleset: Ruleset
    time_control: TimeControl
    limits: Limits = BEHIND_A_WALL
    has_wall: bool = True
    opponents: Sequence[str] = OPPONENTS
    most_s: float = 10.0
    """Of all its matches; what is slow is cut short."""
    patience_s: float = 30.0
    """How long a fighter may take to be ready."""
    most_bytes: int


class Intake:
    """Checks what waits, on a thread of its own from `__enter__` to `__exit__`, or by `check_next`.

    Parameters
    ----------
    clock
        Seconds since 1970.
    """

    def __init__(
        self,
        store: SeasonStore,
        league: StoredLeague,
        folder: SubmittedFolder,
        terms: CheckTerms,
        *,
        clock: Callable[[], float],
    ) -> None:
        Sandbox(has_wall=terms.has_wall, limits=terms.limits).check()
        self._store, self._league, self._folder, self._terms = store, league, folder, terms
        self._clock = clock
        waiting = store.submissions(league, state=WAITING)
        folder.clear([(one.entry, one.digest) for one in waiting], {one.spec for one in store.versions(league)})
        self._news, self._is_over = Event(), Event()
        self._thread = Thread(target=self._run, name="checks submissions", daemon=True)
        self.is_checking = False
        """Whether a fighter is tried just now."""
        self.failure: BaseException | None = None
        """Why it checks no more."""

    def __enter__(self) -> "Intake":
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._is_over.set()
        self._news.set()
        self._thread.join()

    def wake(self) -> None:
        """Look at once for what waits; from any thread."""
        self._news.set()

    def _run(self) -> None:
        try:
            while not self._is_over.is_set():
                self._news.clear()
                try:
                    has_checked = self.check_next()
                except (StoreError, OSError) as error:  # a server that is away, a disk that is full: it still waits
                    logger.warning("what was submitted cannot be checked now: %s", error)
                    has_checked = False
                if not has_checked:
                    self._news.wait(_LOOK_S)
        except BaseException as error:
            self.failure = error
            raise

    def check_next(self) -> bool:
        """Check what has waited longest; False if nothing does."""
        waiting = self._store.submissions(self._league, state=WAITING)
        if not waiting:
            return False
        one = waiting[0]
        try:
            submission = self._folder.read(one.entry, one.digest, self._terms.most_bytes)
        except InputError as error:
            self._refuse(one, str(error), None)
            return True
        with self._folder.unpacked(submission) as folder:
            self.is_checking = True
            try:
                report, says = self._check(one, folder)
            finally:
                self.is_checking = False
            if self._store.submission(self._league, one.id).state != WAITING:
                self._forget(one)
            elif report is not None and report.is_accepted:
                spec = self._folder.enter(folder, one.digest)
                try:
                    self._store.accept(self._league, one, spec=spec, says=_ACCEPTED, report=_tell(report), now_s=self._clock())
                except WithdrawnError as error:
                    logger.info("%s", error)
                self._forget(one)
            else:
                self._refuse(one, says, None if report is None else _tell(report))
        return True

    def _refuse(self, one: Submission, says: str, report: Mapping[str, Any] | None) -> None:
        logger.info("a submission of %s was refused: %s", one.entry, says)
        self._store.refuse(self._league, one, says, report)
        self._forget(one)

    def _forget(self, one: Submission) -> None:
        """Delete what was checked, unless its owner has withdrawn it and submitted the same again, which waits now."""
        waiting = self._store.submissions(self._league, state=WAITING, entry=one.entry)
        if all(other.digest != one.digest for other in waiting):
            self._folder.forget(one.entry, one.digest)

    def _check(self, one: Submission, folder: Path) -> tuple[Report | None, str]:
        """Return what a check finds, if it began, and a sentence for who submitted it."""
        terms = self._terms
        try:
            report = check(
                fighter_in(folder), terms.ruleset, time_control=terms.time_control, limits=terms.limits,
                has_wall=terms.has_wall, opponents=terms.opponents, most_s=terms.most_s, patience_s=terms.patience_s,
            )  # fmt: skip
        except InputError as error:
            return None, _shorten(str(error), folder)
        except Exception:  # a fighter that makes us fail must not do so for all that come after it
            logger.exception("the check of %s, sent by the key %s, failed", one.entry, one.owner)
            return None, "its check failed, and not by what it says of itself; the organiser has the log"
        findings = [
            replace(found, sentence=_shorten(found.sentence, folder))
            for found in sorted(report.findings, key=lambda found: not found.is_fatal)[:_MOST_FINDINGS]
        ]
        report = replace(report, bot=one.entry, size_bytes=one.n_bytes, findings=tuple(findings))
        return report, findings[0].sentence if findings else ""


def _shorten(sentence: str, folder: Path) -> str:
    """Return a sentence as its reader needs it: of a length that fits, and with no path of this machine."""
    said = clean(sentence.replace(f"{folder.absolute()}/", ""))
    return said if len(said) <= _MOST_LETTERS else f"{said[:_MOST_LETTERS]}..."


def _tell(report: Report) -> dict[str, Any]:
    return {**report.to_dict(), "text": report.describe()}
