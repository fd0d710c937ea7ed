"""Play a fighter against each of a list, and count from its side.

Maps are drawn from a secret of their own: the environments of training derive theirs under another label, so none is met twice.
"""

from collections.abc import Callable, Sequence
from functools import partial

from arena.game.keys import secret_from_seed
from arena.game.ruleset import Ruleset
from arena.local.venue import MatchRecord, play
from policies.registry import load_entry
from tournaments.fixture import Tally, plan_fixture, tally

CANDIDATE = "candidate"
"""The fighter's name in matches: it does not depend on where the file lies, so that maps and results do not either."""


def evaluate(
    ruleset: Ruleset,
    fighter: str,
    against: Sequence[str],
    *,
    pairs: int,
    seed: int,
    advance: Callable[[int], None],
    workers: int | None,
) -> dict[str, Tally]:
    """Return how the fighter did against each opponent; all matches are played at once, by the same processes.

    Parameters
    ----------
    advance
        Is told how many more matches were played.
    """
    secret = secret_from_seed(seed)
    plans = [plan for opponent in against for plan in plan_fixture("evaluation", CANDIDATE, opponent, pairs, secret)]
    load = partial(load_entry, {CANDIDATE: fighter, **{name: name for name in against}})
    records: dict[str, list[MatchRecord]] = {name: [] for name in against}
    for record in play(ruleset, plans, load, n_workers=workers):
        (opponent,) = {record.plan.blue, record.plan.red} - {CANDIDATE}
        records[opponent].append(record.without_journal())
        advance(1)
    return {name: tally(CANDIDATE, name, mine) for name, mine in records.items()}
