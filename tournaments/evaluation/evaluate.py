"""Play a fighter against each of a list, and count from its side.

Maps are drawn from a secret of their own: the environments of training derive theirs under another label, so none is met twice.
"""

from collections.abc import Callable, Iterator, Sequence
from functools import partial

from arena.game.keys import secret_from_seed
from arena.game.ruleset import Ruleset
from arena.local.venue import play
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
) -> Iterator[tuple[str, Tally]]:
    """Yield each opponent with how the fighter did against it.

    Parameters
    ----------
    advance
        Is told how many more matches were played.
    """
    for opponent in against:
        specs = {CANDIDATE: fighter, opponent: opponent}
        plans = plan_fixture("evaluation", CANDIDATE, opponent, pairs, secret_from_seed(seed))
        records = []
        for record in play(ruleset, plans, partial(load_entry, specs), n_workers=workers):
            records.append(record)
            advance(1)
        yield opponent, tally(CANDIDATE, opponent, records)
