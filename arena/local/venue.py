"""The local venue: both policies in this process, many matches in one batch, batches on all cores.

Matches of one pairing fill the rows of a batch; a row whose match has ended takes the next one, so a batch stays full. Nothing
that a match is made of depends on its row, on the batch or on the process: its journal is the same however it is run.
"""

import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from functools import partial
from itertools import groupby
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from arena.game.engine import BatchedGame
from arena.game.ruleset import Ruleset
from arena.game.types import Team
from arena.local import bare
from arena.local.bare import NO_FAULTS, BareFaults, BarePlan, BareResult
from arena.local.saving import MOST_FILES, make_journals_folder, save
from arena.local.workers import send_to_parent, work
from arena.policy import BatchFactory, BatchPolicy, Faults, MatchResult
from arena.records.journal import Mark
from arena.records.journal_batch import JournalBatch
from arena.records.plan import MatchPlan
from arena.records.replay import make_result, match_results

ROWS = 512
"""Matches in a batch: enough to make the cost of a tick in Python small beside that of the games."""
MATCHES_PER_TASK = 4096
"""At most: a worker hands over its results by the task."""
_FEWEST_PER_TASK, _TASKS_PER_WORKER = 32, 4
Load = Callable[[str], BatchFactory]
"""Makes a fighter from its name; a plain function, so that it can be sent to another process."""

BareRecord = tuple[str, BareResult, BareFaults, tuple[int, int], bytes | None]
"""A record as it comes back from another process."""


class MatchRecord(NamedTuple):
    """A match that was played."""

    plan: MatchPlan
    result: MatchResult
    """`score` is blue's."""
    faults: tuple[Faults, Faults]
    n_unreadable: tuple[int, int]
    """Turns of each team with an answer that was not one action per unit, as the journal marks them."""
    journal: bytes | None
    """The canonical journal, unless it was written to a folder."""

    def without_journal(self) -> "MatchRecord":
        """Return the same without its journal, once that is written."""
        return MatchRecord(self.plan, self.result, self.faults, self.n_unreadable, None)

    def points(self, entry: str) -> float:
        """Return what the match is worth to one of its two entries: 1 for a win, 0.5 for a draw, 0 for a loss."""
        return self.result.points(self.plan.team(entry))


class News(NamedTuple):
    """A match of bots has ended: what is told at once, while its record waits for those of the other matches of its task."""

    identity: str
    result: MatchResult
    reasons: tuple[dict[str, str], dict[str, str]]
    """Why each team's units stayed: kinds that the task had not met before, and their first sentences."""


OnNews = Callable[[News], None]
Keep = Callable[[Iterable[MatchRecord]], Iterator[MatchRecord]]
"""Writes journals, and yields their records without them; a plain function or a `partial`, as `Load`."""


def play(
    ruleset: Ruleset,
    plans: Sequence[MatchPlan],
    load: Load,
    *,
    journals: Path | None = None,
    n_workers: int | None = None,
    on_news: OnNews | None = None,
) -> Iterator[MatchRecord]:
    """Play matches and yield each as it ends, in no promised order.

    Parameters
    ----------
    journals
        Folder to write journals into, a file each, or bundles of them if there are more than `arena.local.saving.MOST_FILES`;
        without it, records carry them.
    n_workers
        Processes; by default one per core that this process may use, as far as there is work for them.
    on_news
        Called, perhaps from another thread, as soon as a match ends that a bot played.

    Raises
    ------
    InputError
        A journal cannot be written.
    ArenaError
        A worker died.
    """
    keep = None
    if journals is not None:
        make_journals_folder(journals)
        keep = partial(save, folder=journals, bundled=len(plans) > MOST_FILES)
    n_workers = n_workers or len(os.sched_getaffinity(0))
    tasks = split(plans, n_workers)
    n_workers = min(n_workers, len(tasks))
    if n_workers <= 1:
        for task in tasks:
            yield from _play_task(ruleset, task, load, keep, on_news)
        return
    by_identity = {plan.identity: plan for plan in plans}
    send = None if on_news is None else send_to_parent
    jobs = [partial(play_bare, ruleset, bare.strip(task), load, keep, send) for task in tasks]
    for played in work(jobs, n_workers, None if on_news is None else lambda message: on_news(_news(message))):
        yield from dress(played, by_identity)


def split(plans: Sequence[MatchPlan], n_workers: int) -> list[list[MatchPlan]]:
    """Cut plans into tasks of one pairing each, evenly: enough for all workers to be busy to the end, and no more than that."""

    def pairing(plan: MatchPlan) -> tuple[str, str]:
        return plan.blue, plan.red

    share = -(-len(plans) // (_TASKS_PER_WORKER * n_workers))
    most = min(max(share, _FEWEST_PER_TASK), MATCHES_PER_TASK)
    tasks = []
    for _, group in groupby(sorted(plans, key=pairing), key=pairing):
        whole = list(group)
        n_tasks = -(-len(whole) // most)
        tasks += [whole[task::n_tasks] for task in range(n_tasks)]
    return tasks


def play_bare(
    ruleset: Ruleset,
    plans: list[BarePlan],
    load: Load,
    keep: Keep | None,
    send: Callable[[tuple[Any, ...]], None] | None = None,
) -> list[BareRecord]:
    """Play a task in another process, which sends its news, stripped as well."""
    on_news = None if send is None else lambda news: send((news.identity, bare.strip_result(news.result), news.reasons))
    return [
        (one.plan.identity, bare.strip_result(one.result), bare.strip_faults(one.faults), one.n_unreadable, one.journal)
        for one in _play_task(ruleset, bare.dress(plans), load, keep, on_news)
    ]


def dress(played: list[BareRecord], by_identity: Mapping[str, MatchPlan]) -> Iterator[MatchRecord]:
    """Yield records that came back, with their plans."""
    for identity, result, faults, n_unreadable, journal in played:
        yield MatchRecord(by_identity[identity], make_result(*result), bare.dress_faults(faults), n_unreadable, journal)


def _news(message: tuple[Any, ...]) -> News:
    identity, result, reasons = message
    return News(identity, make_result(*result), reasons)


def _play_task(
    ruleset: Ruleset, plans: list[MatchPlan], load: Load, keep: Keep | None, on_news: OnNews | None
) -> Iterator[MatchRecord]:
    with ExitStack() as fighters:
        blue, red = (_load(load, name, fighters) for name in (plans[0].blue, plans[0].red))
        records = play_batch(ruleset, plans, blue, red)
        if on_news is not None and any(hasattr(make, "most_seats") for make in (blue, red)):
            records = announce(records, on_news)
        yield from records if keep is None else keep(records)


def _load(load: Load, name: str, fighters: ExitStack) -> BatchFactory:
    """Load a fighter, which is closed with `fighters` if it has started anything."""
    make = load(name)
    if not isinstance(make, type) and hasattr(make, "close"):
        fighters.callback(make.close)
    return make


def announce(records: Iterable[MatchRecord], on_news: OnNews) -> Iterator[MatchRecord]:
    """Yield records of one pairing, each once its news is told."""
    known: tuple[set[str], set[str]] = (set(), set())
    for record in records:
        blue, red = (
            {kind: sentence for kind, (sentence, _) in faults.reasons.items() if kind not in before}
            for faults, before in zip(record.faults, known, strict=True)
        )
        for before, new in zip(known, (blue, red), strict=True):
            before.update(new)
        on_news(News(record.plan.identity, record.result, (blue, red)))
        yield record


def play_batch(ruleset: Ruleset, plans: Iterable[MatchPlan], blue: BatchFactory, red: BatchFactory) -> Iterator[MatchRecord]:
    """Play matches of one pairing in this thread, as many at a time as suits both fighters."""
    waiting = list(plans)[::-1]
    rows = min(getattr(make, "most_seats", ROWS) for make in (blue, red))
    batch = Batch(ruleset, min(rows, len(waiting)), blue, red)
    batch.start(range(batch.n_rows), [waiting.pop() for _ in range(batch.n_rows)])
    while batch.running:
        free = []
        for row, record in batch.play_tick():
            yield record
            free.append(row)
        refill = free[: len(waiting)]
        batch.start(refill, [waiting.pop() for _ in refill])
        batch.empty(free[len(refill) :])


class Batch:
    """Rows of running matches, their fighters, and their journals so far."""

    def __init__(self, ruleset: Ruleset, n_rows: int, blue: BatchFactory, red: BatchFactory) -> None:
        self.n_rows = n_rows
        self.running: dict[int, MatchPlan] = {}
        self.games = BatchedGame(ruleset, n_rows)
        self.fighters: dict[Team, BatchPolicy] = {
            team: make(ruleset, team, n_rows) for team, make in zip(Team, (blue, red), strict=True)
        }
        self._hear_ends = [team for team, fighter in self.fighters.items() if type(fighter).end is not BatchPolicy.end]
        self._may_fail = any(type(fighter).take_faults is not BatchPolicy.take_faults for fighter in self.fighters.values())
        sizes = self.games.n_units
        self.orders = {team: np.zeros((n_rows, sizes[team]), np.int8) for team in Team}
        self._n_unreadable = np.zeros((n_rows, len(Team)), np.int64)
        self._is_running = np.zeros(n_rows, np.bool_)
        self._journals = JournalBatch(ruleset, n_rows, self.games.digestible().shape[1])

    def start(self, rows: Sequence[int], plans: Sequence[MatchPlan]) -> None:
        """Begin new matches in free rows."""
        if not rows:
            return
        self.games.start(rows, [plan.keys for plan in plans])
        self._n_unreadable[rows] = 0
        self._is_running[rows] = True
        self._journals.start(rows, plans, self.games.state.ground[rows], self.games.digestible(rows))
        self.running.update(zip(rows, plans, strict=True))
        for fighter in self.fighters.values():
            if type(fighter).name_match is not BatchPolicy.name_match:
                for row, plan in zip(rows, plans, strict=True):
                    fighter.name_match(row, plan.identity)
            fighter.start(np.asarray(rows, np.intp))

    def empty(self, rows: Sequence[int]) -> None:
        """Take all units off rows whose match has ended: for nobody, fighters have nothing to think about."""
        self.games.state.alive[rows] = 0

    def play_tick(self) -> list[tuple[int, MatchRecord]]:
        """Play one tick of every running match; return the rows whose match ended, with its record."""
        self.ask()
        return self.step()

    def ask(self) -> None:
        """Have the fighters write their `orders`; negative ones are no orders."""
        seen = self.games.observe()
        for team, fighter in self.fighters.items():
            self.orders[team][:] = 0
            told = self.games.observe_without_fog() if type(fighter).is_cheat else seen
            fighter.act(told[team], self.orders[team])

    def step(self) -> list[tuple[int, MatchRecord]]:
        """Play what was ordered; return as `play_tick` does."""
        orders = np.concatenate([self.orders[team] for team in Team], axis=1)
        marks: np.ndarray | int = 0
        if orders.min(initial=0) < 0:
            unreadable = np.stack([(self.orders[team] < 0).any(axis=1) for team in Team], axis=1)
            self._n_unreadable += unreadable
            marks = unreadable.astype(np.uint8) * np.uint8(Mark.UNREADABLE)
            np.maximum(orders, 0, out=orders)
        self.games.step(orders)
        self._journals.add_tick(np.flatnonzero(self._is_running), orders, marks, self.games.digestible())
        ended = np.flatnonzero(self.games.is_over & self._is_running).tolist()
        if not ended:
            return []
        self._is_running[ended] = False
        results, n_unreadable = match_results(self.games, ended), self._n_unreadable[ended].tolist()  # at once: numpy is slow
        journals = self._journals.finish(ended, results)
        return [
            (row, self._finish(row, result, (blue, red), journal))
            for row, result, (blue, red), journal in zip(ended, results, n_unreadable, journals, strict=True)
        ]

    def _finish(self, row: int, result: MatchResult, n_unreadable: tuple[int, int], journal: bytes) -> MatchRecord:
        for team in self._hear_ends:
            self.fighters[team].end(row, result.seen_by(team))
        blue, red = self.fighters.values()
        faults = (blue.take_faults(row), red.take_faults(row)) if self._may_fail else NO_FAULTS
        return MatchRecord(self.running.pop(row), result, faults, n_unreadable, journal)
