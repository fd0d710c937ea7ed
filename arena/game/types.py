"""The words of the game: teams, actions, the codes of a cell, and how a match ends."""

from enum import IntEnum

RULES_VERSION = 1
"""Rises whenever the same keys and orders would give another match."""


class Team(IntEnum):
    """A side of the board."""

    BLUE = 0
    RED = 1

    @property
    def other(self) -> "Team":
        """The enemy."""
        return Team(1 - self)


class Action(IntEnum):
    """What one unit may be told. Source: paper, Eq. 3."""

    STAY = 0
    NORTH = 1
    EAST = 2
    SOUTH = 3
    WEST = 4


class Code(IntEnum):
    """What a cell shows. Source: paper, Table 2."""

    HIDDEN = -1
    BLUE_HALF = 0
    RED_HALF = 1
    BLUE_UGV = 2
    BLUE_UAV = 3
    RED_UGV = 4
    RED_UAV = 5
    BLUE_FLAG = 6
    RED_FLAG = 7
    OBSTACLE = 8


HALVES = (Code.BLUE_HALF, Code.RED_HALF)
FLAGS = (Code.BLUE_FLAG, Code.RED_FLAG)
UGVS = (Code.BLUE_UGV, Code.RED_UGV)
UAVS = (Code.BLUE_UAV, Code.RED_UAV)


class Termination(IntEnum):
    """Why a match is over."""

    RUNNING = 0
    CAPTURE = 1
    ELIMINATION = 2
    TICK_LIMIT = 3
    FORFEIT = 4
    """A seat vanished, or gave no order in time too often; nothing that the rules of the game know."""
    VOID = 5
    """The pit's own fault: never scored, played again."""
