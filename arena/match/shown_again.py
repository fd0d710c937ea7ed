"""What a seat was shown, made again from the match's keys and orders: to keep it of all seats would be most of a pit's memory."""

from collections.abc import Sequence

import numpy as np

from arena.game.engine import BatchedGame
from arena.game.types import Team
from arena.protocol.observation_codec import ObservationWriter
from arena.records.journal import Header


def show_again(header: Header, orders: Sequence[bytes], team: Team, banks_s: Sequence[float] | None) -> list[bytes]:
    """Return the observations of a seat, from the first to that which the last orders answered.

    Parameters
    ----------
    orders
        Of both teams, tick by tick.
    banks_s
        The extra time that observations say, tick by tick; None where no clock runs.
    """
    games = BatchedGame(header.ruleset, 1)
    games.start([0], [header.keys])
    writer, shown = ObservationWriter(games.observe()[team], 0), list[bytes]()
    for tick, played in enumerate(orders):
        if banks_s is not None:
            writer.set_clock(banks_s[tick])
        shown.append(writer.write())
        games.play(np.frombuffer(played, np.int8)[None])
    return shown
