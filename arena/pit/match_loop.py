"""The one thread of a process that referees: it hands what comes to a core, and carries out what that wants done.

Zenoh's callbacks put into bounded queues and do nothing else.
"""

import time
from collections.abc import Callable, Sequence
from pathlib import Path
from queue import SimpleQueue
from typing import Any, Protocol

from arena.errors import UnreadableError
from arena.folders import data_folder
from arena.network.session import Collector, Put, Sample, Session, read_key, read_payload
from arena.pit.channels import MatchChannels, OpenJournal, open_lane
from arena.pit.effects import Append, CloseMatch, Effect, OpenMatch, PublishEnding, PublishTick, Send, SendBundle
from arena.pit.events import ActionReceived, ActionsTaken, BundleReceived, Event, Stopped
from arena.pit.journal_files import JournalFile, OpenJournals, SpareJournals
from arena.protocol import topics

MOST_WAITING = 10_000
"""Messages in a queue; what comes beyond is dropped, and asked for again."""
SWEEP_S = 0.01
_MOST_JUNK = 256  # messages beyond two of each match that are handed in before something else is done
_MOST_AT_ONCE = 32
"""Actions that are handed in before what was gathered for clients is sent."""
_LEAST_MESSAGE_BYTES = 92
"""Of orders in a bundle."""
_IN_MATCH: dict[type[Effect], Callable[[MatchChannels, Any], None]] = {
    Append: MatchChannels.append,
    Send: MatchChannels.send,
    PublishTick: MatchChannels.publish_tick,
    PublishEnding: MatchChannels.publish_ending,
}


class Core(Protocol):
    """What decides."""

    def receive(self, event: Event, now_s: float) -> list[Effect]:
        """Take an event; return what is to be done."""

    @property
    def n_running(self) -> int:
        """Matches that are not over."""

    @property
    def holds_bundles(self) -> bool:
        """Whether something was gathered for clients, and waits for the next event that is no action."""


class MatchLoop:
    """The actions, the channels and the journals of the matches of one process.

    Parameters
    ----------
    actions
        What seats say, and a beat that comes every `SWEEP_S` at least.
    carry_out
        What else the core may want done than is done here.
    spare
        Sets the spare journals of this process apart from those of others.
    """

    def __init__(
        self,
        session: Session,
        pit: str,
        core: Core,
        actions: Collector,
        journals: Path,
        *,
        fsync: bool,
        is_delayed_public: bool,
        carry_out: dict[type[Effect], Callable[[Any], None]],
        spare: str = "",
    ) -> None:
        self._session, self._pit, self._core, self._actions = session, pit, core, actions
        self._journals, self._fsync, self._is_delayed_public = journals, fsync, is_delayed_public
        self._inbox: SimpleQueue[Callable[[], Event]] = SimpleQueue()
        self._channels: dict[str, MatchChannels] = {}
        self._lanes: dict[int, list[Put]] = {}
        self._bundle_lanes: dict[int, Put] = {}
        self._is_stopping, self._has_failed = False, False
        self._empty_at_s = 0.0
        """When no action waited."""
        self._left_at_s = 0.0
        """When this thread last left the actions for something else."""
        self._carry_out: dict[type[Effect], Callable[[Any], None]] = {
            OpenMatch: self._open_match,
            CloseMatch: lambda effect: self._channels.pop(effect.match).close(),
            SendBundle: self._send_bundle,
            **carry_out,
        }
        data_folder(journals)
        self._open_journals = OpenJournals()
        self._spare_journals = SpareJournals(journals, fsync=fsync, name=spare, among=self._open_journals)

    @property
    def n_running(self) -> int:
        """Matches that are not over."""
        return self._core.n_running

    def stop(self) -> None:
        """Leave `run` as soon as its thread notices; from any thread, or a signal."""
        self._is_stopping = True

    def run(self, until: Callable[[], bool]) -> None:
        """Referee until `until()`, asked every hundredth of a second, or until `stop`."""
        next_sweep_s = 0.0
        while not self._is_stopping:
            if not self._take_actions(_MOST_AT_ONCE):
                sample = self._actions.wait()  # at the latest when the next beat comes
                self._note_beat()
                self._empty_at_s = self._read_clock()
                self._take_action(sample, None)
            now_s = self._read_clock()
            if now_s >= next_sweep_s:
                self._take_actions()
                self._left_at_s = self._read_clock()
                for _ in range(self._inbox.qsize()):
                    self._hand_in(self._inbox.get()())
                next_sweep_s = now_s + SWEEP_S
                self._sweep(now_s)
                if until():
                    return

    def close(self) -> None:
        """Leave every match as it stands: a later process can resume it."""
        self._spare_journals.close()
        if not self._has_failed:  # else the core takes for done what was not
            self._hand_in(Stopped())

    def _sweep(self, now_s: float) -> None:
        """Do what is done every hundredth of a second."""
        raise NotImplementedError

    def _note_beat(self) -> None:
        """Something came, after nothing had."""

    def _read_clock(self) -> float:
        return time.monotonic()

    # Events

    def _hand_in(self, event: Event) -> list[Effect]:
        """Hand an event to the core and carry out what it wants done."""
        effects = self._core.receive(event, self._read_clock())
        try:
            self._perform(effects)
        except BaseException:
            self._has_failed = True
            raise
        return effects

    def _perform(self, effects: Sequence[Any]) -> None:
        effect: Any  # of one of two kinds, told by its type, which a dictionary knows and a type checker does not
        for effect in effects:
            in_match = _IN_MATCH.get(type(effect))
            if in_match is not None:
                in_match(self._channels[effect.match], effect)
            else:
                self._carry_out[type(effect)](effect)

    def _take_action(self, sample: Sample, arrived_s: float | None) -> int:
        """Hand in an action, or several in a bundle; return about how many."""
        try:
            lane, team = topics.read_action(read_key(sample))
        except UnreadableError:
            return 1  # as of every beat
        payload = read_payload(sample)
        if team is not None:
            self._hand_in(ActionReceived(lane, team, payload, arrived_s))
            return 1
        self._hand_in(BundleReceived(lane, payload, arrived_s))
        return 1 + len(payload) // _LEAST_MESSAGE_BYTES

    def _take_actions(self, most: int | None = None) -> bool:
        """Hand in the actions that have come, and return whether any had.

        Not the answers to what follows, or it would never end where all are quick. They came while this thread did something
        else, which no seat is charged for: their clocks stop when the queue was seen empty last, or when this thread left it.
        """
        n_taken, n_since_sent, most = 0, 0, most or 2 * self._core.n_running + _MOST_JUNK
        while n_taken < most and (sample := self._actions.take()) is not None:
            n_actions = self._take_action(sample, max(self._empty_at_s, self._left_at_s))
            n_taken, n_since_sent = n_taken + n_actions, n_since_sent + n_actions
            if n_since_sent >= _MOST_AT_ONCE:
                n_since_sent = 0
                self._send_bundles()
        if n_taken < most:
            self._empty_at_s = self._read_clock()
        self._send_bundles()
        return n_taken > 0

    def _send_bundles(self) -> None:
        if self._core.holds_bundles:
            self._hand_in(ActionsTaken())

    # Effects

    def _open_journal(self, effect: OpenMatch) -> OpenJournal:
        if effect.n_bytes:
            return JournalFile(self._journals / effect.journal, effect.n_bytes, fsync=self._fsync, among=self._open_journals)
        return self._spare_journals.take(effect.journal)

    def _open_match(self, effect: OpenMatch) -> None:
        puts = self._lanes.get(effect.lane)
        if puts is None:
            puts = self._lanes[effect.lane] = open_lane(self._session, self._pit, effect.lane)
        self._channels[effect.match] = MatchChannels(
            self._session, self._pit, self._open_journal(effect), effect.match, puts, self._is_delayed_public
        )

    def _send_bundle(self, effect: SendBundle) -> None:
        put = self._bundle_lanes.get(effect.lane)
        if put is None:
            put, _ = self._session.publisher(topics.observation(self._pit, effect.lane, None))
            self._bundle_lanes[effect.lane] = put
        put(effect.payload)
