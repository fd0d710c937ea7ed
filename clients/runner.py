"""A client process: one connection and one thread around a `ClientCore`, whose effects it carries out.

It loses nothing but time when the pit goes away: it connects anew, and the core asks for the seats that it held.
"""

import logging
import math
import time
import uuid
from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack
from dataclasses import dataclass, field
from functools import partial
from queue import Empty, SimpleQueue
from typing import Any

from arena.errors import LostPitError, ProtocolError
from arena.network.session import Collector, Put, Sample, Session, is_heartbeat, open_client, read_payload
from arena.protocol import topics
from arena.protocol.bundles import BundleWriter, read_bundle, seat_number
from arena.protocol.messages import Ticket
from arena.records.transcript import TranscriptHeader, TranscriptWriter, transcript_name
from clients import events
from clients.core import ClientCore
from clients.seat import Seat
from clients.settings import ClientSettings
from policies.precompile import precompile

logger = logging.getLogger(__name__)
MOST_WAITING = 2_000
"""Messages in the queue."""
TICK_S = 0.25
"""Between two looks at the connection and the clock."""
MOST_HELD_S = 0.002
"""How long an answer waits for others that go in the same bundle: where policies take their time, none waits for another's."""


@dataclass(slots=True)
class _Channel:
    """The two keys of a slot's seat, over one connection."""

    seat: events.OpenSeat
    put: Put
    closing: ExitStack = field(default_factory=ExitStack)
    collector: Collector | None = None
    """None where messages come by callbacks."""


class BundleChannel:
    """The two keys of a lane of bundles, and the slots whose seats it is of."""

    def __init__(self, put: Put) -> None:
        self._put, self._writer = put, BundleWriter()
        self.slots: dict[int, int] = {}
        """By the number of their seat."""
        self.closing = ExitStack()
        self.add = self._writer.add

    def send(self) -> None:
        """Publish what was gathered."""
        for bundle in self._writer.take():
            self._put(bundle)

    def take_apart(self, sample: Sample) -> Iterator[events.Event]:
        """Yield the messages of a bundle, each for its slot; none of what is no bundle, or for a seat that is not held."""
        try:
            messages = read_bundle(read_payload(sample))
        except ProtocolError as error:
            logger.info("dropped a message on the key of bundles that the referee did not send: %s", error)
            return
        for number, message in messages:
            slot = self.slots.get(number)
            if slot is not None:
                yield events.MessageReceived(slot, message)


class Runner:
    """Plays until there is nothing more to play."""

    _session: Session
    """The connection that stands, or stood last."""

    def __init__(
        self,
        settings: ClientSettings,
        *,
        on_seat: Callable[[Seat], None],
        on_end: Callable[[Seat], None],
        on_wait: Callable[[str], None],
        on_tick: Callable[[], None] = lambda: None,
    ) -> None:
        self._settings = settings
        self._on_seat, self._on_end, self._on_wait, self._on_tick = on_seat, on_end, on_wait, on_tick
        self._client = uuid.uuid4().hex
        self._core = ClientCore(settings, self._client, self._make_seat)
        self._inbox: SimpleQueue[Callable[[], Iterable[events.Event]]] = SimpleQueue()
        """What makes the next events, so that messages are taken apart on the one thread."""
        self._channels: dict[int, _Channel] = {}
        self._bundles: dict[int, BundleChannel] = {}
        """By lane."""
        self._sent_at_s = -math.inf
        """When all that was gathered was published."""
        self._is_stopping = False

    def stop(self) -> None:
        """Leave `run` soon; from a signal."""
        self._is_stopping = True

    def wake(self) -> None:
        """Ask policies that needed longer at once; from any thread, and of use with `is_patient`."""
        self._enqueue(lambda: (events.Woken(),))

    def run(self) -> int:
        """Play, and return how many matches ended.

        Raises
        ------
        LostPitError
            The pit could not be reached for `patience_s`.
        RefusedError
            The pit does not let this client play.
        """
        settings, core = self._settings, self._core
        precompile(settings.make)
        while not (self._is_stopping or core.is_done):
            failure = LostPitError(f"no pit called {settings.pit} answers at {settings.endpoint}")
            try:
                with open_client(settings.endpoint, settings.authority) as session:
                    self._serve(session)
            except LostPitError as error:
                failure = error
            if not self._is_stopping:
                self._carry_out(core.receive(events.Disconnected(failure), time.monotonic()))
        return core.n_ended

    def _serve(self, session: Session) -> None:
        """Play over one connection, until all is played or the pit is lost."""
        core, self._session = self._core, session
        session.declare_presence(topics.presence(self._settings.pit, self._settings.name, self._client))
        core.receive(events.Connected(), time.monotonic())
        checked_at_s = -math.inf
        try:
            while not (self._is_stopping or core.is_done):
                now_s = time.monotonic()
                if now_s - checked_at_s > TICK_S:
                    checked_at_s = now_s
                    self._on_tick()
                    self._take_all()
                    if not session.is_connected() or not self._carry_out(core.receive(events.TimePassed(), now_s)):
                        return
                    self._send_bundles(now_s)
                self._hand_in(self._wait())
                if not self._inbox.qsize():
                    self._send_bundles(time.monotonic())
        finally:
            for slot in list(self._channels):
                self._close(slot)
            for lane in list(self._bundles):
                self._bundles.pop(lane).closing.close()

    def _take_all(self) -> None:
        """Hand in what has arrived; not the answers to what follows."""
        channel = self._channels.get(0)
        take = None if channel is None or channel.collector is None else channel.collector.take
        arrived = [self._inbox.get() for _ in range(self._inbox.qsize())]
        while take is not None and len(arrived) < MOST_WAITING and (sample := take()) is not None:
            if not is_heartbeat(sample):
                arrived.append(partial(_deliver, 0, sample))
        for take_apart in arrived:
            self._hand_in(take_apart())

    def _hand_in(self, happened: Iterable[events.Event]) -> None:
        for event in happened:
            now_s = time.monotonic()
            if now_s - self._sent_at_s > MOST_HELD_S:
                self._send_bundles(now_s)
            self._carry_out(self._core.receive(event, now_s))

    def _send_bundles(self, now_s: float) -> None:
        for channel in self._bundles.values():
            channel.send()
        self._sent_at_s = now_s

    def _wait(self) -> Iterable[events.Event]:
        """Return what happens next; nothing if nothing does for about `TICK_S`."""
        channel = self._channels.get(0)
        try:
            if channel is None or channel.collector is None:
                return self._inbox.get(timeout=TICK_S)()
            payload = read_payload(channel.collector.wait())
            return (events.MessageReceived(0, payload),) if payload else self._inbox.get_nowait()()
        except Empty:
            return ()

    def _enqueue(self, take_apart: Callable[..., Iterable[events.Event]], *arguments: Any) -> None:
        """Leave what arrived for the one thread, on one of Zenoh's; what is beyond the bound is sent again."""
        if self._inbox.qsize() < MOST_WAITING:
            self._inbox.put(partial(take_apart, *arguments))

    def _carry_out(self, effects: list[events.Effect]) -> bool:
        """Do what the core wants done; False if it wants another connection."""
        for effect in effects:
            match effect:
                case events.Publish():
                    self._channels[effect.slot].put(effect.payload)
                case events.Query():
                    on_reply = partial(self._enqueue, _reply, effect.id)
                    self._session.ask(effect.key, effect.payload, on_reply, effect.timeout_s)
                case events.OpenSeat():
                    self._open(effect)
                case events.CloseSeat():
                    self._close(effect.slot)
                case events.MatchBegun():
                    _log("seat taken", effect.seat)
                    self._on_seat(effect.seat)
                case events.MatchEnded():
                    _log("match ended", effect.seat, **effect.seat.result().to_dict())
                    self._on_end(effect.seat)
                case events.Waiting():
                    self._on_wait(effect.reason)
                case events.Audited() if self._settings.on_audit is not None:
                    self._settings.on_audit(effect.seat, effect.verdict)
                case events.Reconnect():
                    return False
        return True

    def _open(self, seat: events.OpenSeat) -> None:
        """Declare the two keys of a seat, or those of its bundles.

        The messages of a single seat are queued outside Python, which spares each turn a tenth of its time. Those of several come
        by callbacks, and so do those for a policy that takes its time, since it may have its answer while no message comes.
        """
        session, pit, slot = self._session, self._settings.pit, seat.slot
        if slot in self._channels:
            if self._channels[slot].seat == seat:
                return
            self._close(slot)
        if seat.bundle_lane is not None:
            bundles, number = self._bundles_of(seat.bundle_lane), seat_number(seat.lane, seat.team)
            bundles.slots[number] = slot
            self._channels[slot] = _Channel(seat, partial(bundles.add, number))
            self._channels[slot].closing.callback(bundles.slots.pop, number)
            return
        put, end = session.publisher(topics.action(pit, seat.lane, seat.team))
        channel = self._channels[slot] = _Channel(seat, put)
        channel.closing.callback(end)
        key = topics.observation(pit, seat.lane, seat.team)
        if self._settings.n_slots > 1 or self._settings.is_patient:
            channel.closing.callback(session.subscribe(key, partial(self._enqueue, _deliver, slot)))
            return
        channel.collector = session.collect(key, MOST_WAITING)
        channel.closing.callback(channel.collector.end)
        channel.closing.callback(session.heartbeat(key, TICK_S))

    def _bundles_of(self, lane: int) -> BundleChannel:
        """Return the channel of a lane; those that no slot uses are closed as another is opened."""
        if lane not in self._bundles:
            for unused in [lane for lane, channel in self._bundles.items() if not channel.slots]:
                self._bundles.pop(unused).closing.close()
            session, pit = self._session, self._settings.pit
            put, end = session.publisher(topics.action(pit, lane, None))
            channel = self._bundles[lane] = BundleChannel(put)
            channel.closing.callback(end)
            key = topics.observation(pit, lane, None)
            channel.closing.callback(session.subscribe(key, partial(self._enqueue, channel.take_apart)))
        return self._bundles[lane]

    def _close(self, slot: int) -> None:
        self._channels.pop(slot).closing.close()

    def _make_seat(self, ticket: Ticket, commitment: bytes, pit_key: bytes) -> Seat:
        settings = self._settings
        n_in_turn = 1 if settings.is_patient else settings.n_slots  # a patient client's policies think elsewhere, side by side
        seat = Seat(ticket, commitment, settings.make, clock=time.monotonic, n_in_turn=n_in_turn)
        if settings.transcripts is not None:
            header = TranscriptHeader(
                match=ticket.match,
                pit=settings.pit,
                pit_key=pit_key,
                entry_key=settings.identity.public,
                name=settings.name,
                opponent=ticket.opponent,
                team=seat.team,
                ruleset=seat.ruleset,
                commitment=commitment,
            )
            name = transcript_name(settings.pit, ticket.match, seat.team)
            seat.keep(TranscriptWriter(settings.transcripts / name, header), explains=settings.explains)
        return seat


def _log(event: str, seat: Seat, **more: object) -> None:
    team = seat.team.name.lower()
    facts = {"event": event, "match": seat.ticket.match, "team": team, "opponent": seat.ticket.opponent, **more}
    logger.info("%s: %s in match %s against %s", event, team, seat.ticket.match, seat.ticket.opponent, extra={"facts": facts})


def _deliver(slot: int, sample: Sample) -> Iterable[events.Event]:
    return (events.MessageReceived(slot, read_payload(sample)),)


def _reply(query: int, payload: bytes) -> Iterable[events.Event]:
    return (events.ReplyReceived(query, payload),)
