"""A bot against the shipped fighters, on the same maps each time: `arena gauntlet`."""

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import Any

from arena.errors import InputError, UnknownNameError
from arena.game.keys import secret_from_seed
from arena.game.observation import Observations
from arena.game.ruleset import Ruleset
from arena.game.types import Team
from arena.local.venue import MatchRecord, OnNews, play
from arena.policy import BatchFactory, BatchPolicy, Orders
from arena.records.journal import journal_name
from arena.records.plan import MatchPlan
from policies.registry import SCRIPTS, load, load_entry, names, read_specs, shipped
from policies.workers.files import resolve
from tournaments.authoring.turn_times import TurnTimes
from tournaments.fixture import Tally, plan_fixture, tally
from tournaments.league.entries import name_of

_LEAGUE = "gauntlet"


@dataclass(frozen=True, slots=True, kw_only=True)
class WorstMap:
    """The pair that brought the bot least, and the journal of the match that it lost higher."""

    pair: int
    points: float
    """Of 2."""
    journal: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Encounter:
    """How the bot did against one opponent."""

    opponent: str
    tally: Tally
    """From the bot's side."""
    pairs: tuple[float, ...]
    """What it scored in each pair, 0 to 2, in their planned order."""
    turns: TurnTimes
    """Of the first pair."""
    worst: WorstMap | None
    """None if it lost no match."""

    def to_dict(self) -> dict[str, Any]:
        """Return what programs are told, and what is kept for the next gauntlet."""
        counted = asdict(self.tally)
        faults = counted.pop("faults")
        own = next(found for name, found in faults.items() if name != self.opponent)
        return {
            "opponent": self.opponent,
            **counted,
            "pairs": list(self.pairs),
            "faults": own,
            "turns": {name: round(value, 3) for name, value in asdict(self.turns).items()},
            "worst_map": None if self.worst is None else asdict(self.worst),
        }


def find_opponents(bot: str, against: Sequence[str] | None) -> tuple[list[str], list[str]]:
    """Return whom a bot meets, and sentences on those who are left out.

    Parameters
    ----------
    against
        As `policies.registry.read_specs` takes it; without it, all shipped fighters that can be loaded here, the bot itself
        apart. Of the planners, which are one fighter with three budgets, only the fastest: the others would take longer than all
        else together.

    Raises
    ------
    InputError
        Nobody is named, or somebody who is no fighter.
    """
    if against is not None:
        opponents = read_specs(against)
        if not opponents:
            raise InputError(
                f"--against is {','.join(against)!r}; it must name fighters, divided by commas: arena policies lists them"
            )
        for name in opponents:
            if name not in names():
                raise UnknownNameError("policy", name, names())
            load(name)
        return opponents, []
    found, left_out = [], []
    for name in (*SCRIPTS, "planner-fast", *shipped()):
        if name == bot:
            continue
        try:
            load(name)
        except InputError as error:  # a network, where torch is not installed
            left_out.append(f"without {name}: {error}")
        else:
            found.append(name)
    return found, left_out


def name_bot(spec: str, opponents: Sequence[str]) -> str:
    """Return what a bot is called in its matches: as its file, or as the folder of one that is called bot, but as no opponent."""
    name = name_of(spec)
    _, found = resolve(spec)
    if name == "bot" and found:
        name = name_of(f"{found[0].parent}.py")
    return f"{name}-2" if name in opponents else name


def plan_gauntlet(name: str, opponents: Sequence[str], n_pairs: int, seed: int) -> dict[str, list[MatchPlan]]:
    """Return the matches against each opponent, pair by pair."""
    secret = secret_from_seed(seed)
    return {opponent: plan_fixture(_LEAGUE, name, opponent, n_pairs, secret) for opponent in opponents}


def play_gauntlet(
    ruleset: Ruleset,
    fixtures: Mapping[str, Sequence[MatchPlan]],
    specs: Mapping[str, str],
    name: str,
    *,
    journals: Path,
    n_workers: int | None,
    on_news: OnNews | None,
    advance: Callable[[MatchRecord], None],
) -> list[Encounter]:
    """Play a bot against its opponents, and return how it did against each, the hardest first.

    The first pair against each is played in this process, with nothing beside it, to measure how long the bot thinks.

    Parameters
    ----------
    specs
        By name, what each fighter is made from; `name` is the bot's.
    advance
        Is told of each match.
    """
    find = partial(load_entry, dict(specs))
    records: dict[str, list[MatchRecord]] = {opponent: [] for opponent in fixtures}
    took_s: dict[str, list[float]] = {opponent: [] for opponent in fixtures}

    def take(some: Iterator[MatchRecord]) -> None:
        for record in some:
            advance(record)
            records[record.plan.entry(record.plan.team(name).other)].append(record)

    for opponent, plans in fixtures.items():
        measured = {name: _measured(find(name), took_s[opponent]), opponent: find(opponent)}
        take(play(ruleset, plans[:2], measured.__getitem__, journals=journals, n_workers=1, on_news=on_news))
    rest = [plan for plans in fixtures.values() for plan in plans[2:]]
    take(play(ruleset, rest, find, journals=journals, n_workers=n_workers, on_news=on_news))
    met = [_count(name, opponent, fixtures[opponent], records[opponent], took_s[opponent], journals) for opponent in fixtures]
    return sorted(met, key=lambda one: one.tally.score)


def _measured(make: BatchFactory, took_s: list[float]) -> BatchFactory:
    """Return a factory of a fighter for one match at a time that writes down how long each turn takes."""

    def make_measured(ruleset: Ruleset, team: Team, n_seats: int) -> BatchPolicy:
        fighter = make(ruleset, team, n_seats)
        act = fighter.act

        def act_and_measure(observations: Observations, orders: Orders) -> None:
            before_s = time.perf_counter()
            act(observations, orders)
            took_s.append(time.perf_counter() - before_s)

        vars(fighter)["act"] = act_and_measure
        return fighter

    vars(make_measured)["most_seats"] = 1
    return make_measured


def _count(
    name: str,
    opponent: str,
    plans: Sequence[MatchPlan],
    records: Sequence[MatchRecord],
    took_s: Sequence[float],
    journals: Path,
) -> Encounter:
    played = {record.plan.identity: record for record in records}
    in_order = [played[plan.identity] for plan in plans]
    pairs = tuple(one.points(name) + other.points(name) for one, other in zip(in_order[::2], in_order[1::2], strict=True))
    return Encounter(
        opponent=opponent,
        tally=tally(name, opponent, records),
        pairs=pairs,
        turns=TurnTimes.of(took_s),
        worst=_find_worst(name, pairs, in_order, journals),
    )


def _find_worst(name: str, pairs: Sequence[float], in_order: Sequence[MatchRecord], journals: Path) -> WorstMap | None:
    """Return the pair with the fewest points, of several the one with the lowest scores of the game."""
    number = min(range(len(pairs)), key=lambda pair: (pairs[pair], sum(_score(name, one) for one in in_order[2 * pair :][:2])))
    match = min(in_order[2 * number :][:2], key=lambda record: (record.points(name), _score(name, record)))
    if match.points(name) > 0:
        return None
    return WorstMap(pair=number, points=pairs[number], journal=str(journals / journal_name(match.plan.identity)))


def _score(name: str, record: MatchRecord) -> int:
    return record.result.seen_by(record.plan.team(name)).score
