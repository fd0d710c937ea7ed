"""A league: who meets whom under which rules, never changed after. `tournaments.league.file` reads one."""

import json
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

from arena.errors import InputError
from arena.game.ruleset import Ruleset
from arena.match.time_control import TimeControl
from arena.sandbox.limits import BEHIND_A_WALL, NO_LIMITS, Limits
from arena.sandbox.process import Sandbox
from policies.registry import is_file_or_program
from tournaments.league.entries import fingerprint_of, public_key_of
from tournaments.league.season import SeasonTerms
from tournaments.ratings.sprt import Sprt

VENUES = ("network", "local", "ray")
PAIRINGS = ("round-robin", "gauntlet", "sprt")
MAPS = ("paired", "fresh")
DEFAULT_TERMS = TimeControl()


class LeagueError(InputError):
    """A league holds a value that cannot be played."""


@dataclass(frozen=True, kw_only=True)
class League:
    """What a league's file says. `definition` is what decides its results."""

    name: str
    ruleset: Ruleset
    entries: Mapping[str, str]
    """The fighter behind each entry, as `tournaments.league.entries` knows it; files by their full path."""
    commands: Mapping[str, str] = field(default_factory=dict)
    """The command lines of programs as the league's file has them, by entry: they are the same wherever its folder lies."""
    n_pairs: int = 10
    """Of each fixture; may be raised while results are stored. The most pairs of a sequential test."""
    challenger: str | None = None
    """Who meets all the others in a gauntlet, or is tested for being the better one; None in a round robin."""
    sprt: Sprt | None = None
    """The test that ends a league of two, before its first pair."""
    maps: str = "paired"
    """`paired`: both matches of a pair on one map; `fresh`: no map twice, for entries that remember."""
    seed: int | None = None
    secret: bytes | None = None
    """None, without a seed: made at the first run, and kept beside the results."""
    venue: str = "network"
    listen: str = ""
    """Endpoint of the pit in the venue `network`, as Zenoh writes it; any free port of loopback without it."""
    time_control: TimeControl = DEFAULT_TERMS
    slots: int | None = None
    """Seats that the process of an entry holds at once; None takes as many as this machine can think for."""
    has_walls: bool = True
    """Whether strangers' fighters play behind walls."""
    trusted: frozenset[str] = frozenset()
    """Entries that are files or programs, and need no wall."""
    season: SeasonTerms | None = None
    """What makes a season of it, whose entries are submitted; its file's own entries are the organiser's."""
    limits: Limits = NO_LIMITS
    """For each process of a stranger's fighter; what is None there is as behind every wall."""

    @cached_property
    def remote(self) -> Mapping[str, bytes]:
        """The public keys of the entries that join by themselves."""
        keys = {name: public_key_of(spec) for name, spec in self.entries.items()}
        return {name: key for name, key in keys.items() if key is not None}

    @cached_property
    def sandboxes(self) -> Mapping[str, Sandbox]:
        """Where the fighters run that are files or programs, by entry."""
        return {name: self._sandbox(name) for name, spec in self.entries.items() if is_file_or_program(spec)}

    def _sandbox(self, name: str) -> Sandbox:
        return self.strangers_sandbox if name not in self.trusted else self._make_sandbox(has_wall=False)

    @cached_property
    def strangers_sandbox(self) -> Sandbox:
        """Where a fighter runs that is a file or a program, and that nobody trusts."""
        return self._make_sandbox(has_wall=self.has_walls)

    def _make_sandbox(self, *, has_wall: bool) -> Sandbox:
        return Sandbox(has_wall=has_wall, limits=(BEHIND_A_WALL if has_wall else NO_LIMITS).with_(self.limits.assignments()))

    @cached_property
    def definition(self) -> dict[str, Any]:
        """What decides the results, but for the secret and the number of pairs; an edit is found by comparing these."""
        time_control, sprt = self.time_control, self.sprt
        return {
            "ruleset": self.ruleset.name,
            "rules": self.ruleset.hash,
            "entries": {name: fingerprint_of(spec, self.commands.get(name, "")) for name, spec in sorted(self.entries.items())},
            "clock": {"turn_time_s": time_control.turn_time_s, "bank_s": time_control.bank_s, "grace_s": time_control.grace_s},
            **({"maps": self.maps} if self.maps != League.maps else {}),
            **({"challenger": self.challenger} if self.challenger is not None else {}),
            **({"season": True} if self.season is not None else {}),
            **({"sprt": {name: getattr(sprt, name) for name in BOUNDS}} if sprt is not None else {}),
        }

    def labelled(self, labels: Mapping[str, str]) -> "League":
        """Return the league with its entries called as their versions are; `labels` is by entry."""
        return replace(
            self,
            entries={labels[name]: spec for name, spec in self.entries.items()},
            commands={labels[name]: command for name, command in self.commands.items()},
            challenger=None if self.challenger is None else labels[self.challenger],
            trusted=frozenset(labels[name] for name in self.trusted),
        )

    def check_venue(self, venue: str) -> None:
        """Refuse a venue that an entry cannot come to."""
        for name in self.remote:
            if venue != "network":
                raise LeagueError(
                    f'league {self.name} names {name} by its key, and who joins by itself can only come to venue = "network"'
                )
        strangers = [name for name, one in self.sandboxes.items() if not one.has_wall and name not in self.trusted]
        if venue != "network" and strangers:
            raise LeagueError(
                f'league {self.name} plays {" and ".join(strangers)} without walls in venue = "{venue}", where a fighter could '
                f"read and write what all others think; if you trust them, write trusted = {json.dumps(strangers)}, else leave "
                'out sandbox = "none"'
            )


BOUNDS = ("elo0", "elo1", "alpha", "beta")
"""What [sprt] of a league's file says of its test."""
