"""A match that is to be played: what it is called, who plays it, and its keys.

Journals and stores call a match by its identity, a text:

    LEAGUE/ONE/OTHER/PAIR/BLUE-blue/REPEAT    of a league
    PIT/NUMBER/BLUE/RED                       of an open pit
    PIT/ladder/NUMBER/BLUE/RED                of an open pit with a ladder

Two pits, or two runs of a league, may give the same identity. On the network, and in the files of clients, a match is called by a
name that is unique in the world (`network_name`).
"""

import re
from dataclasses import dataclass
from hashlib import sha256
from typing import NamedTuple, Self

from arena.game.keys import MatchKeys
from arena.game.types import Team

_LEAGUE = re.compile(r"([^/]+)/([^/]+)/([^/]+)/(\d{4}|[1-9]\d{4,})/([^/]+)-blue/(0|[1-9]\d*)", re.ASCII)
_PIT = re.compile(r"([^/]+)/(ladder/)?(\d{6}|[1-9]\d{6,})/([^/]+)/([^/]+)", re.ASCII)


def network_name(identity: str, pit_key: bytes, nonce: bytes) -> str:
    """Return what a match is called on the network.

    Parameters
    ----------
    nonce
        Random bytes that its pit drew for this match alone, and wrote into the journal; none in journals of before, whose matches
        were called by their identity alone.
    """
    if not nonce:
        return sha256(identity.encode()).hexdigest()[:16]
    return sha256(b"arena match\0" + pit_key + nonce + identity.encode()).hexdigest()[:24]


@dataclass(frozen=True, slots=True, kw_only=True)
class LeagueMatchId:
    """The identity of a league's match; `str` writes it."""

    league: str
    one: str
    """Of the two entries, the one whose name is sorted first."""
    other: str
    pair: int
    """Of the fixture, from 0."""
    blue: str
    """Who of the two plays blue."""
    repeat: int = 0

    @property
    def fixture(self) -> str:
        """What all matches of two entries, and no others, have in common."""
        return f"{self.league}/{self.one}/{self.other}"

    @property
    def pair_id(self) -> str:
        """What the two matches of a pair, and no others, have in common."""
        return f"{self.fixture}/{self.pair:04}"

    def __str__(self) -> str:
        return f"{self.pair_id}/{self.blue}-blue/{self.repeat}"

    @classmethod
    def parse(cls, identity: str) -> Self:
        """Read what `str` wrote; `ValueError` if that is no match of a league."""
        found = _LEAGUE.fullmatch(identity)
        if found is None:
            raise ValueError(f"{identity!r} is no match of a league")
        league, one, other, pair, blue, repeat = found.groups()
        return cls(league=league, one=one, other=other, pair=int(pair), blue=blue, repeat=int(repeat))


@dataclass(frozen=True, slots=True, kw_only=True)
class PitMatchId:
    """The identity of a match in an open pit; `str` writes it."""

    pit: str
    is_rated: bool
    """Whether it is of the pit's ladder."""
    number: int
    """Of the pit, or of its ladder, from 0."""
    blue: str
    red: str

    def __str__(self) -> str:
        return f"{self.pit}/{'ladder/' if self.is_rated else ''}{self.number:06}/{self.blue}/{self.red}"

    @classmethod
    def parse(cls, identity: str) -> Self:
        """Read what `str` wrote; `ValueError` if that is no match of an open pit."""
        found = _PIT.fullmatch(identity)
        if found is None:
            raise ValueError(f"{identity!r} is no match of an open pit")
        pit, ladder, number, blue, red = found.groups()
        return cls(pit=pit, is_rated=ladder is not None, number=int(number), blue=blue, red=red)


class MatchPlan(NamedTuple):
    """A match to be played."""

    identity: str
    blue: str
    """What blue's fighter is made from, and its name in the journal."""
    red: str
    keys: MatchKeys

    def entry(self, team: Team) -> str:
        """Return who plays a team."""
        return (self.blue, self.red)[team]

    def team(self, entry: str) -> Team:
        """Return which team one of the two plays."""
        return Team.BLUE if self.blue == entry else Team.RED
