"""The one thread of a process that referees: it hands what comes to a core, and carries out what that wants done.

Zenoh's callbacks put into bounded queues and do nothing else.
"""

import time
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from queue import SimpleQueue
from typing import Any, Protocol

from arena.errors import UnreadableError
from arena.folders import data_folder
from arena.network.session import Collector, Put, Sample, Session, read_key, read_payload
from arena.pit.channels import MatchChannels, OpenJournal, open_lane
from arena.pit.effects import Append, CloseMatch, Effect, OpenMatch, PublishEnding, PublishTick, Send, SendBundle
from arena.pit.events import ActionReceived, ActionsTaken, BundleReceived, Event, Stopped
from arena.pit.gate import Gate
from arena.pit.journal_files import JournalFile, OpenJournals, SpareJournals
from arena.pit.journal_sync import JournalSync, SyncedJournal
from arena.protocol import topics

MOST_WAITING = 10_000
"""Messages in a queue; what comes beyond is dropped, and asked for again."""
SWEEP_S = 0.01
_SETTLE_S, _SETTLE_LOOK_S = 5.0, 0.001
"""How long the last records may take to stand, and how often that is looked at."""
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
    beat
        The key of that beat.
    fsync
        Whether what follows from a record waits until the disk has it.
    gate
        Holds back what follows from records that stand elsewhere, if they do.
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
        beat: str,
        fsync: bool,
        gate: Gate | None = None,
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
        self._spare_journals = SpareJournals(journals, name=spare, among=self._open_journals)
        self._gate = Gate() if fsync else gate
        self._sync: JournalSync | None = None
        if self._gate is not None:
            wake, self._end_waking = session.waker(beat)
            self._wake = partial(wake, b"")
        if fsync and self._gate is not None:
            self._sync = JournalSync(self._gate, self._wake)

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
                self._release()
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
            self._settle()
        if self._sync is not None:
            self._sync.close()

    def _settle(self) -> None:
        """Wait until all that was written stands, and what follows from it is done."""
        end_s = time.monotonic() + _SETTLE_S
        while self._gate is not None and not self._gate.is_open and time.monotonic() < end_s:
            self._release()
            time.sleep(_SETTLE_LOOK_S)
        if self._gate is not None:
            self._end_waking()

    def _release(self) -> None:
        """Do what waited for records that stand now."""
        if self._sync is not None and (error := self._sync.error) is not None:
            self._has_failed = True
            raise error
        if self._gate is not None:
            self._gate.release()

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
        """Carry effects out in their order; what follows from a record, once that stands."""
        gate = self._gate
        if gate is None:
            self._do(effects)
            return
        for effect in effects:
            if isinstance(effect, OpenMatch | Append) or gate.is_open:
                self._do([effect])
            elif isinstance(effect, PublishTick):  # what it tells is to be told as it is now
                for put, payload in self._channels[effect.match].make_tick(effect):
                    gate.hold(partial(put, payload))
            else:
                gate.hold(partial(self._do, [effect]))

    def _do(self, effects: Sequence[Any]) -> None:
        effect: Any  # of one of two kinds, told by its type, which a dictionary knows and a type checker does not
        for effect in effects:
            in_match = _IN_MATCH.get(type(effect))
            if in_match is not None:
                in_match(self._channels[effect.match], effect)
            else:
                self._carry_out[type(effect)](effect)

    def _take_action(self, sample: Sample, arrived_s: float | None) -> int:
        """Hand in an action, or several in a bundle; return about how many."""
        if self._gate is not None:
            self._release()
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
        """Hand in the actions that have come, and return whether more may wait.

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
        is_empty = n_taken < most
        if is_empty:
            self._empty_at_s = self._read_clock()
        return self._send_bundles() or not is_empty

    def _send_bundles(self) -> bool:
        """Send what was gathered for clients, and return whether anything was: more may have come meanwhile."""
        if not self._core.holds_bundles:
            return False
        self._hand_in(ActionsTaken())
        return True

    # Effects

    def _open_journal(self, effect: OpenMatch) -> OpenJournal:
        if effect.n_bytes:
            journal = JournalFile(self._journals / effect.journal, effect.n_bytes, among=self._open_journals)
        else:
            journal = self._spare_journals.take(effect.journal)
        return journal if self._sync is None else SyncedJournal(journal, self._sync)

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
