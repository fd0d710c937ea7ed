"""The transcripts of local matches, as a client of a pit keeps them: what each seat saw, ordered, logged and drew."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from arena.game.observation import Observations
from arena.game.ruleset import Ruleset
from arena.game.types import Team
from arena.policy import BatchFactory, BatchPolicy, Faults, MatchResult, Orders
from arena.protocol.observation_codec import ObservationWriter
from arena.records.journal import journal_name
from arena.records.plan import network_name
from arena.records.transcript import HEAD_BYTES, TranscriptHeader, TranscriptWriter

_PIT = "local"
_NO_KEY = bytes(HEAD_BYTES)
_MOST_SEATS = 32
"""Of one fighter at once: each is an open file."""


def load_transcribed(
    load: Callable[[str], BatchFactory], opponents: Mapping[str, str], folder: Path, name: str, *, explains: bool
) -> BatchFactory:
    """Return the fighter that `load` returns, whose transcripts are kept; a cheat's, which is shown no fog, are not."""
    make = load(name)
    if isinstance(make, type) and issubclass(make, BatchPolicy) and make.is_cheat:
        return make
    most_seats = min(getattr(make, "most_seats", _MOST_SEATS), _MOST_SEATS)
    return _Transcribed(make=make, most_seats=most_seats, folder=folder, explains=explains, name=name, opponent=opponents[name])


@dataclass(frozen=True, slots=True, kw_only=True)
class _Transcribed:
    """The `BatchFactory` of a fighter whose transcripts are kept."""

    make: BatchFactory
    most_seats: int
    folder: Path
    explains: bool
    """As a `BatchPolicy` has it."""
    name: str
    opponent: str

    def __call__(self, ruleset: Ruleset, team: Team, n_seats: int) -> BatchPolicy:
        return _Policy(self.make(ruleset, team, n_seats), self)


class _Policy(BatchPolicy):
    """Hands everything on to a fighter, and writes down what it is shown and what it answers."""

    def __init__(self, policy: BatchPolicy, seat: _Transcribed) -> None:
        super().__init__(policy.ruleset, policy.team, policy.n_seats)
        self._policy, self._seat = policy, seat
        self._policy.keeps_annotations = True
        self.explains = seat.explains
        self._matches = [""] * policy.n_seats
        self._writers: dict[int, TranscriptWriter] = {}
        self._annotations = [b""] * policy.n_seats

    def name_match(self, seat: int, match: str) -> None:
        self._matches[seat] = match
        self._policy.name_match(seat, match)

    def start(self, seats: NDArray[np.intp]) -> None:
        self._policy.explains = self.explains
        for seat in seats.tolist():
            self._writers[seat] = self._begin(self._matches[seat])
        self._policy.start(seats)

    def act(self, observations: Observations, orders: Orders) -> None:
        self._policy.act(observations, orders)
        for seat, writer in self._writers.items():
            self._annotations[seat] = self._policy.take_annotations(seat)
            observation = ObservationWriter(observations, seat).write()
            writer.add(observation, orders[seat].tobytes(), annotations=self._annotations[seat])

    def end(self, seat: int, result: MatchResult) -> None:
        self._policy.end(seat, result)
        self._writers.pop(seat).end(result)

    def take_faults(self, seat: int) -> Faults:
        return self._policy.take_faults(seat)

    def take_annotations(self, seat: int) -> bytes:
        taken, self._annotations[seat] = self._annotations[seat], b""
        return taken

    def _begin(self, identity: str) -> TranscriptWriter:
        header = TranscriptHeader(
            match=network_name(identity, b"", b""),
            pit=_PIT,
            pit_key=_NO_KEY,
            entry_key=_NO_KEY,
            name=self._seat.name,
            opponent=self._seat.opponent,
            team=self.team,
            ruleset=self.ruleset,
            commitment=_NO_KEY,
        )
        stem = journal_name(identity).removesuffix(".journal")
        return TranscriptWriter(self._seat.folder / f"{stem}+{self.team.name.lower()}.transcript", header)
