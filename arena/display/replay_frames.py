"""A journal as frames, for a page that knows no rules: the match played again, and whether it holds."""

from typing import Any

import numpy as np

from arena.display.frame import describe_rules, describe_tick, orders_to_text
from arena.errors import JournalError
from arena.game.engine import BatchedGame
from arena.game.state import StateField
from arena.game.types import Team
from arena.records.journal import Journal, read_journal
from arena.records.replay import BrokenChainError, replay
from arena.records.verification import check_seals


def describe_match(data: bytes) -> dict[str, Any]:
    """Play a journal's bytes again, and return every tick of it up to the first that does not hold.

    Returns
    -------
    dict
        `ticks` as `arena.display.frame.describe_tick` gives them, `rules`, who played, how it ended, and under `broken` None,
        or the tick and the sentence on what does not hold.

    Raises
    ------
    JournalError
        It is no journal, or of a match that is not over: that one may not be seen.
    """
    journal = read_journal(data)
    header, ending = journal.header, journal.ending
    if ending is None:
        raise JournalError("the match is not over, so its journal may not be seen")
    ticks: list[dict[str, Any]] = []
    broken = None
    try:
        for number, games in enumerate(replay(journal)):
            ticks.append(_describe(games, journal.ticks[number].orders if number < len(journal.ticks) else None))
        broken = _find_forgery(journal)
    except BrokenChainError as error:
        broken = {"tick": error.tick, "sentence": str(error)}
    return {
        "match": journal.name,
        "identity": header.identity,
        "names": [header.blue, header.red],
        "rules": describe_rules(header.ruleset),
        "ticks": ticks,
        "ending": ending.to_dict(),
        "marks": [[int(mark) for mark in tick.marks] for tick in journal.ticks],
        "broken": broken,
        "is_sealed": journal.seals is not None,
    }


def _find_forgery(journal: Journal) -> dict[str, Any] | None:
    """Return what is wrong with the signatures of a journal whose every tick holds."""
    checked = check_seals(journal)
    if checked is None or checked.is_sound:
        return None
    sentence = "the journal was signed by others than it says, or the pit broke its commitment"
    return {"tick": len(journal.ticks), "sentence": sentence}


def _describe(games: BatchedGame, orders: bytes | None) -> dict[str, Any]:
    state, side = games.state, games.ruleset.side
    field = state.field[0]
    every = [(cell // side, cell % side, bool(alive)) for cell, alive in zip(state.cell[0].tolist(), state.alive[0], strict=True)]
    n_blue = games.n_units[Team.BLUE]
    grids = games.grids()
    return describe_tick(
        int(field[StateField.TICK]),
        score=int(field[StateField.SCORE]),
        living=(int(field[StateField.BLUE_LIVING]), int(field[StateField.RED_LIVING])),
        truth=games.truth(0),
        seen=[grids[team, 0] for team in Team],
        units=(every[:n_blue], every[n_blue:]),
        events={
            name: [(int(unit >= n_blue), unit - n_blue * (unit >= n_blue)) for unit in np.flatnonzero(flags[0]).tolist()]
            for name, flags in games.events._asdict().items()
        },
        orders=None if orders is None else [orders_to_text(orders[:n_blue]), orders_to_text(orders[n_blue:])],
    )
