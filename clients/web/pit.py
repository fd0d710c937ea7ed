"""The pit as the pages know it: its lobby, how the last matches ended, and matches as they run.

One Zenoh session for all pages. Its callbacks only enqueue; everything else happens on the loop of the web server. When the pit
goes away, it is looked for until it is back.
"""

import asyncio
import queue
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

from arena.display.frame import Units, describe_rules, describe_tick, find_events
from arena.errors import ArenaError, InputError, LostPitError, ProtocolError
from arena.game.ruleset import Ruleset, read_rules
from arena.network.address import Address
from arena.network.session import Sample, Session, open_client, read_key, read_payload
from arena.protocol import topics
from arena.protocol.codec import MOST_LISTED
from arena.protocol.messages import Lobby
from clients.lobby import ask_challenge, ask_journal, ask_lobby
from clients.spectator import MOST_WAITING, Frame, Spectator

_EVERY_S = 1.0
"""How often the lobby is asked, and a lost pit looked for."""
_MOST_RESULTS = 20
_MOST_MATCHES = 2_000
"""Of which the names are remembered."""
_MOST_SENT = 200
"""Messages that wait for a page that does not read; the oldest go."""


@dataclass(eq=False, slots=True)
class Watch:
    """A page that watches a match."""

    match: str
    key: bytes | None
    spectator: Spectator | None = None
    """Made anew with every connection to the pit."""
    messages: asyncio.Queue[dict[str, Any]] = field(default_factory=lambda: asyncio.Queue(_MOST_SENT))
    has_opened: bool = False
    """The key opened a truth."""
    is_warned: bool = False
    units: Units | None = None
    """Of the last frame."""

    def send(self, message: dict[str, Any]) -> None:
        """Leave a message for the page."""
        if self.messages.full():
            self.messages.get_nowait()
        self.messages.put_nowait(message)


class PitClient:
    """A connection to one pit, kept up by `run`."""

    def __init__(self, address: Address, authority: Path | None, trust: Callable[[bytes], None]) -> None:
        self.address = address
        self.authority, self.trust = authority, trust
        self.lobby: Lobby | None = None
        """None while the pit does not answer."""
        self.trouble = "the pit was not asked yet"
        self.results: deque[dict[str, Any]] = deque(maxlen=_MOST_RESULTS)
        """How matches ended while this page was open, the last first."""
        self._facts: dict[str, Frame] = {}
        self._watches: set[Watch] = set()
        self._truths: dict[str, Callable[[], None]] = {}
        """By match: what ends hearing its truth."""
        self._past_truths: dict[str, Callable[[], None]] = {}
        """Likewise for those that everyone may see, later."""
        self._session: Session | None = None
        self._pit_key = b""
        self._ruleset: Ruleset | None = None
        self._heard: queue.Queue[tuple[Callable[[str, bytes], None], Sample]] = queue.Queue(MOST_WAITING)
        self._loop: asyncio.AbstractEventLoop | None = None

    async def run(self) -> None:
        """Stay connected, until cancelled."""
        self._loop = asyncio.get_running_loop()
        while True:
            try:
                with await asyncio.to_thread(open_client, self.address.endpoint, self.authority) as session:
                    await self._serve(session)
                self.trouble = "the pit has closed"
            except ArenaError as error:
                self.trouble = str(error)
            finally:
                self._session, self.lobby = None, None
                self._truths.clear()
                self._past_truths.clear()
            for watch in self._watches:
                watch.send({"kind": "lost", "sentence": self.trouble})
            await asyncio.sleep(_EVERY_S)

    async def _serve(self, session: Session) -> None:
        """Listen, and keep asking for the lobby, as long as the pit is there."""
        challenge = await asyncio.to_thread(ask_challenge, session, self.address)
        self.trust(challenge.pit_key)
        self._pit_key = challenge.pit_key
        self.lobby = await asyncio.to_thread(ask_lobby, session, self.address, self._pit_key)
        self._ruleset = read_rules(self.lobby.ruleset)
        session.subscribe(topics.all_public(self.address.pit), partial(self._enqueue, self._hear_public))
        self._session = session
        for watch in self._watches:
            watch.spectator = None
            self._begin(watch)
        while session.is_connected():
            await asyncio.sleep(_EVERY_S)
            self.lobby = await asyncio.to_thread(ask_lobby, session, self.address, self._pit_key)

    async def runs(self, match: str) -> bool:
        """Whether a match runs now; `LostPitError` if the pit is gone."""
        if self._session is None:
            raise LostPitError(self.trouble)
        try:
            self.lobby = await asyncio.to_thread(ask_lobby, self._session, self.address, self._pit_key)
        except ProtocolError as error:
            raise LostPitError(str(error)) from error
        is_full = len(self.lobby.running) == MOST_LISTED
        return any(one["match"] == match for one in self.lobby.running) or (is_full and match in self._facts)

    @contextmanager
    def watch(self, match: str, key: bytes | None) -> Iterator[Watch]:
        """Hear of a match that runs, as long as the pit does; with the spectator key, its truth."""
        watch = Watch(match=match, key=key)
        self._watches.add(watch)
        self._begin(watch)
        try:
            yield watch
        finally:
            self._watches.discard(watch)
            for subscriptions, has_key in ((self._truths, True), (self._past_truths, False)):
                if not any(other.match == match and bool(other.key) is has_key for other in self._watches):
                    subscriptions.pop(match, lambda: None)()

    def _begin(self, watch: Watch) -> None:
        """Tell a page what is known, and hear its match's truth if it has a key; the pit makes no truth for nobody."""
        session, ruleset = self._session, self._ruleset
        if session is None or ruleset is None:
            watch.send({"kind": "lost", "sentence": self.trouble})
            return
        watch.spectator = Spectator(self.address.pit, watch.match, ruleset, self._pit_key, watch.key)
        delay = 0 if self.lobby is None else self.lobby.public_delay
        watch.send({"kind": "rules", "rules": describe_rules(ruleset), "public_delay": delay})
        if (facts := self._facts.get(watch.match)) is not None:
            watch.send(_describe(facts))
        elif self.lobby is not None:
            for one in self.lobby.running:
                if one["match"] == watch.match:
                    names = one["blue"], one["red"]
                    watch.send({"kind": "public", "tick": one["tick"], "names": names, "living": None, "score": None})
        if watch.key is not None and watch.match not in self._truths:
            truth = topics.truth(self.address.pit, watch.match)
            self._truths[watch.match] = session.subscribe(truth, partial(self._enqueue, self._hear_truth))
        if watch.key is None and watch.match not in self._past_truths:
            past = topics.delayed(self.address.pit, watch.match)
            self._past_truths[watch.match] = session.subscribe(past, partial(self._enqueue, self._hear_past_truth))

    async def fetch_journal(self, match: str) -> bytes:
        """Return the journal of a match that is over; `ArenaError` says why it cannot be had."""
        if self._session is None:
            raise LostPitError(self.trouble)
        return await asyncio.to_thread(ask_journal, self._session, self.address, match)

    def _enqueue(self, hear: Callable[[str, bytes], None], sample: Sample) -> None:
        with suppress(queue.Full, RuntimeError):  # the next tick tells all anew; or the server has ended
            self._heard.put_nowait((hear, sample))
            if self._loop is not None:
                self._loop.call_soon_threadsafe(self._hear)

    def _hear(self) -> None:
        with suppress(queue.Empty, ProtocolError):  # anybody may publish; what the pit did not say counts for nothing
            hear, sample = self._heard.get_nowait()
            hear(topics.read_match(read_key(sample)), read_payload(sample))

    def _hear_truth(self, match: str, payload: bytes) -> None:
        for watch in [one for one in self._watches if one.match == match and one.key and one.spectator]:
            try:
                frame = watch.spectator.read_truth(payload) if watch.spectator else None
            except (ProtocolError, InputError):  # whoever watches beside it may have the right key
                if not watch.has_opened and not watch.is_warned:
                    watch.is_warned = True
                    watch.send({"kind": "wrong key", "sentence": "the truth of this match does not open with this key"})
                continue
            if frame is not None and self._ruleset is not None:
                watch.has_opened = True
                watch.send(_describe_frame(watch, frame, self._ruleset))

    def _hear_past_truth(self, match: str, payload: bytes) -> None:
        for watch in [one for one in self._watches if one.match == match and one.key is None]:
            if watch.spectator is not None and self._ruleset is not None:
                watch.send(_describe_frame(watch, watch.spectator.read_past_truth(payload), self._ruleset))

    def _hear_public(self, match: str, payload: bytes) -> None:
        if self._ruleset is None:
            return
        frame = Spectator(self.address.pit, match, self._ruleset, self._pit_key, None).read_public(payload)
        if frame is None:
            return
        if frame.ended is not None and all(one["match"] != match for one in self.results):
            before = self._facts.pop(match, None)
            names = None if before is None else before.names
            self.results.appendleft({"match": match, "names": names} | _describe_ending(frame))
        elif frame.ended is None and (match in self._facts or len(self._facts) < _MOST_MATCHES):
            self._facts[match] = frame
        for watch in [one for one in self._watches if one.match == match]:
            watch.send(_describe(frame))


def _describe(frame: Frame) -> dict[str, Any]:
    """Return a frame as what a page is sent."""
    if frame.ended is not None:
        return {"kind": "ended", "ending": _describe_ending(frame)}
    return {"kind": "public", "tick": frame.tick, "names": frame.names, "living": frame.living, "score": frame.score}


def _describe_frame(watch: Watch, frame: Frame, ruleset: Ruleset) -> dict[str, Any]:
    """Return an opened truth as what a page is sent."""
    assert frame.truth is not None
    assert frame.seen is not None
    assert frame.units is not None
    before, units = watch.units, [[(unit.row, unit.column, unit.alive) for unit in team] for team in frame.units]
    watch.units = units
    described = describe_tick(
        frame.tick,
        score=frame.score,
        living=frame.living or (0, 0),
        truth=frame.truth,
        seen=frame.seen,
        units=units,
        events=find_events(ruleset, before, units),
    )
    return {"kind": "frame", **described}


def _describe_ending(frame: Frame) -> dict[str, Any]:
    ended = frame.ended
    assert ended is not None
    return {
        "ending": ended.ending,
        "winner": ended.winner,
        "score": ended.score,
        "ticks": ended.ticks,
        "reason": ended.reason,
        "faults": ended.faults,
    }
