"""One running match as a spectator sees it: the public facts, and both fogged views and the truth.

Those are for holders of the spectator key; a pit may also show them to everyone with a delay.
"""

import queue
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from arena.errors import ForgedError, InputError, LostPitError, ProtocolError, UnreadableError
from arena.game.observation import OwnUnit
from arena.game.ruleset import Ruleset, read_rules
from arena.game.types import Team
from arena.network.address import Address
from arena.network.session import Sample, Session, open_client, read_key, read_payload
from arena.protocol import topics
from arena.protocol.codec import MOST_LISTED, decode
from arena.protocol.messages import Ended, Lobby, PastTruth, PublicState, Signed, Truth
from arena.protocol.observation_codec import ObservationReader
from arena.protocol.sealing import Opener, truth_opener
from arena.protocol.signed import read_statement
from clients.lobby import ask_challenge, ask_lobby

SALT_BYTES = 32
MOST_WAITING = 1_000
MOST_CLOSED = 5
"""Truths that do not open, in a row, by which a spectator key is known to be another pit's."""
_SILENCE_S = 5.0
"""After which the pit is asked whether a match still runs."""
_MOST_SILENCE_S = 60.0
"""Of a match that a full lobby does not name: then it is taken to be over."""
Grid = NDArray[np.int8]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Frame:
    """What a spectator sees at one tick."""

    tick: int
    names: tuple[str, str] | None = None
    """Of blue's entry, and red's; only of a public message."""
    living: tuple[int, int] | None = None
    """Blue's units, red's."""
    score: int = 0
    """Blue's."""
    truth: Grid | None = None
    """int8, shape (side, side), codes of Table 2; as `seen`, for holders of the spectator key."""
    seen: tuple[Grid, Grid] | None = None
    """What blue sees, and red."""
    units: tuple[tuple[OwnUnit, ...], tuple[OwnUnit, ...]] | None = None
    """Blue's, and red's, as their teams see them."""
    ended: Ended | None = None
    is_past: bool = False
    """Whether this is how it was some ticks ago, as everyone is shown it."""


class Spectator:
    """Makes frames of a match's messages. Without I/O."""

    def __init__(self, pit: str, match: str, ruleset: Ruleset, pit_key: bytes, spectator_key: bytes | None) -> None:
        self._pit, self._match, self._pit_key, self._key = pit, match, pit_key, spectator_key
        self._side, self._ruleset = ruleset.side, ruleset
        self._readers = [ObservationReader(ruleset, team) for team in Team]
        self._openers: dict[bytes, Opener] = {}
        self._n_closed = 0

    def read_public(self, payload: bytes) -> Frame | None:
        """Return the frame of a public message, if it makes one; `ProtocolError` if the pit did not publish it."""
        message = decode(payload)
        if isinstance(message, PublicState):
            if (
                len(message.living) != len(Team)
                or len(message.names) != len(Team)
                or not all(map(topics.is_label, message.names))
            ):
                raise UnreadableError("the facts are not of two teams")
            blue, red = message.living
            return Frame(tick=message.tick, names=(message.names[0], message.names[1]), living=(blue, red), score=message.score)
        fact = read_statement(message, self._pit_key) if isinstance(message, Signed) else None
        if isinstance(fact, Ended) and fact.match != self._match:
            raise ForgedError("the ending is of another match")
        return Frame(tick=fact.ticks, score=fact.score, ended=fact) if isinstance(fact, Ended) else None

    def read_truth(self, payload: bytes) -> Frame | None:
        """Return the frame of a sealed truth, None without a key; `ProtocolError` if it does not open.

        Raises
        ------
        InputError
            Nothing has opened so far: the key is not this pit's.
        """
        if self._key is None:
            return None
        self._n_closed += 1
        if self._n_closed > MOST_CLOSED and not self._openers:
            raise InputError("the truth does not open with this spectator key; the pit's own is keys/spectator.key in its --data")
        salt, sealed = payload[:SALT_BYTES], payload[SALT_BYTES:]
        opener = self._openers.get(salt) or truth_opener(self._key, salt, self._pit, self._match)
        message = decode(opener.open(sealed))
        self._openers[salt] = opener  # of a process of the pit; a stranger's did not open
        if not isinstance(message, Truth):
            raise UnreadableError("a truth is none of this ruleset")
        return self._frame(message, is_past=False)

    def read_past_truth(self, payload: bytes) -> Frame:
        """Return the frame of a truth that everyone may see; `ProtocolError` if the pit did not publish it."""
        message = decode(payload)
        fact = read_statement(message, self._pit_key) if isinstance(message, Signed) else None
        if not isinstance(fact, PastTruth) or fact.match != self._match:
            raise ForgedError("this is no truth of the match")
        return self._frame(fact, is_past=True)

    def _frame(self, message: Truth, *, is_past: bool) -> Frame:
        if len(message.board) != self._side**2 or len(message.seen) != len(Team):
            raise UnreadableError("a truth is none of this ruleset")
        board = np.frombuffer(message.board, np.int8).reshape(self._side, self._side)
        observations = [reader.read(data) for reader, data in zip(self._readers, message.seen, strict=True)]
        blue, red = (seen.seat(0, self._ruleset) for seen in observations)
        return Frame(
            tick=message.tick,
            living=blue.living,
            score=blue.score,
            truth=board,
            seen=(blue.grid, red.grid),
            units=(blue.units, red.units),
            is_past=is_past,
        )


_Read = Callable[[Spectator, bytes], Frame | None]
"""What makes a frame of a message, by where it came."""


def watch(
    address: Address,
    authority: Path | None,
    match: str,
    trust: Callable[[bytes], None],
    spectator_key: bytes | None,
    tell_waiting: Callable[[], None],
) -> Iterator[tuple[str, Frame]]:
    """Yield the frames of a match until it ends; of the first that publishes, if none is named.

    Without a key, boards come where the pit shows them to everyone with a delay.

    Parameters
    ----------
    trust
        Raises if the pit whose public key it is given is not the one that was meant.
    tell_waiting
        Called once if no match runs yet, before the first is waited for.

    Yields
    ------
    tuple
        The match, and its frame.

    Raises
    ------
    LostPitError
        No pit answers, or the match does not run.
    """
    inbox: queue.Queue[tuple[_Read, Sample]] = queue.Queue(maxsize=MOST_WAITING)
    spectator: Spectator | None = None
    with open_client(address.endpoint, authority) as session:
        pit_key = ask_challenge(session, address).pit_key
        trust(pit_key)
        session.subscribe(topics.all_public(address.pit), partial(_enqueue, inbox, Spectator.read_public))
        if spectator_key is not None:
            session.subscribe(topics.all_truths(address.pit), partial(_enqueue, inbox, Spectator.read_truth))
        else:
            session.subscribe(topics.all_delayed(address.pit), partial(_enqueue, inbox, Spectator.read_past_truth))
        lobby = _check_running(session, address, pit_key, match)
        if not lobby.running:
            tell_waiting()
        ruleset = read_rules(lobby.ruleset)
        asked_at_s = heard_at_s = time.monotonic()
        while True:
            now_s = time.monotonic()
            if now_s - asked_at_s > _SILENCE_S:
                _check_running(session, address, pit_key, match, now_s - heard_at_s)
                asked_at_s = time.monotonic()
            try:
                read, sample = inbox.get(timeout=_SILENCE_S)
            except queue.Empty:
                continue
            try:
                at = topics.read_match(read_key(sample))
                if match and at != match:
                    continue
                if spectator is None or not match:
                    spectator = Spectator(address.pit, at, ruleset, pit_key, spectator_key)
                frame = read(spectator, read_payload(sample))
            except ProtocolError:
                continue  # anybody may publish: only what the pit sealed or signed counts
            if frame is not None:
                match = at
                asked_at_s = heard_at_s = time.monotonic()
                yield match, frame
                if frame.ended is not None:
                    return


def _check_running(session: Session, address: Address, pit_key: bytes, match: str, silent_s: float = 0.0) -> Lobby:
    """Return the lobby; `LostPitError` if the match, which was not heard for so long, does not run."""
    lobby = ask_lobby(session, address, pit_key)
    is_known = len(lobby.running) < MOST_LISTED or silent_s > _MOST_SILENCE_S
    if match and is_known and all(one.get("match") != match for one in lobby.running):
        raise LostPitError(f"match {match} does not run in {address.pit}; `arena watch` without --match waits for the next")
    return lobby


def _enqueue(inbox: "queue.Queue[tuple[_Read, Sample]]", read: "_Read", sample: Sample) -> None:
    try:
        inbox.put_nowait((read, sample))
    except queue.Full:
        return  # the next tick replaces it
