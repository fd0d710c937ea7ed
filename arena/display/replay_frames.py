"""A journal as frames, for a page that knows no rules: the match played again, and whether it holds. And so a transcript."""

from base64 import b64encode
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from arena.display.frame import describe_rules, describe_tick, orders_to_text, to_text
from arena.display.seat_memory import GroundMemory, find_losses
from arena.errors import JournalError
from arena.game.engine import BatchedGame
from arena.game.state import StateField
from arena.game.types import Team
from arena.records.journal import MAGIC, Journal, read_journal
from arena.records.replay import BrokenChainError, replay
from arena.records.transcript import Transcript, begins_transcript, read_transcript
from arena.records.verification import check_seals

_JOURNAL = MAGIC.rpartition(b"-")[0]
"""What journals of all versions begin with."""
MOST_TICKS = 20_000
"""That a page is given at once."""
MOST_CELLS = 1 << 24
"""Likewise, of the boards of all ticks: each cell stands there three times."""


def describe_recording(data: bytes) -> dict[str, Any]:
    """Return what `describe_match` makes of a journal, or `describe_transcript` of a transcript; raises as they do."""
    if begins_transcript(data):
        return describe_transcript(data)
    if not data.startswith(_JOURNAL):
        raise JournalError("this is neither a journal nor a transcript: its first line is another")
    return describe_match(data)


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
        It is no journal, one of more than `MOST_TICKS` or `MOST_CELLS`, or of a match that is not over: that one may not be seen.
    """
    journal = read_journal(data)
    header, ending = journal.header, journal.ending
    if ending is None:
        raise JournalError("the match is not over, so its journal may not be seen")
    _check_length(len(journal.ticks), header.ruleset.side)
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


def describe_transcript(data: bytes) -> dict[str, Any]:
    """Return every tick of a transcript's bytes: what its seat saw and remembered, what it ordered, and what its bot noted.

    Returns
    -------
    dict
        As of `describe_match`, and `team`, whose view it is. Of a tick, `truth` is None, and what `seen`, `units` and `orders`
        hold of the other team is empty. Under `known` stands what is seen, with the ground that is remembered behind it; under
        `charged_us` what the pit's clock charged, or None; under `annotations` the bot's `log` and what it drew (`draw`), a heat
        as base64. `ending` is None if the transcript has none.

    Raises
    ------
    JournalError
        It is no transcript, or one of more than `MOST_TICKS` or `MOST_CELLS`.
    """
    transcript = read_transcript(data)
    header, ending = transcript.header, transcript.ending
    _check_length(len(transcript.ticks), header.ruleset.side)
    names = [header.name, header.opponent]
    return {
        "match": header.match,
        "pit": header.pit,
        "names": names if header.team is Team.BLUE else names[::-1],
        "team": int(header.team),
        "rules": describe_rules(header.ruleset),
        "ticks": list(_describe_seat(transcript)),
        "ending": None if ending is None else ending.seen_by(header.team).to_dict(),
        "broken": None,
        "is_whole": transcript.is_whole,
    }


def _check_length(n_ticks: int, side: int) -> None:
    most = min(MOST_TICKS, MOST_CELLS // side**2)
    if n_ticks > most:
        board = f"a board of {side} by {side} cells"
        raise JournalError(
            f"it has {n_ticks:,} ticks of {board}, and a page shows {most:,} at most; arena replay show has no bound"
        )


def _describe_seat(transcript: Transcript) -> Iterator[dict[str, Any]]:
    team, memory = transcript.header.team, GroundMemory(transcript.header.ruleset.side)
    sign = 1 if team is Team.BLUE else -1
    before = None
    for number, seen in enumerate(transcript.observations()):
        fell = [(int(team), unit.index) for unit in find_losses(before, seen)]
        before = seen
        tick = describe_tick(
            seen.tick,
            score=sign * seen.score,
            living=list(seen.living)[::sign],
            truth=None,
            seen=[seen.grid, None][::sign],
            units=[[(unit.row, unit.column, unit.alive) for unit in seen.units], []][::sign],
            events={"fought": [], "fell": fell, "captured": []},
            orders=[orders_to_text(transcript.ticks[number][1]), ""][::sign],
        )
        yield tick | {
            "known": to_text(memory.recall(seen)[0]),
            "charged_us": transcript.charges_us[number],
            "annotations": _describe_notes(transcript.annotations[number]),
        }


def _describe_notes(notes: Mapping[str, Any]) -> dict[str, Any]:
    """Return what a bot noted on a tick as JSON can hold it."""
    drawings = [{**one, "heat": b64encode(one["heat"]).decode()} if "heat" in one else one for one in notes["draw"]]
    return {"log": notes["log"], "draw": drawings}


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
