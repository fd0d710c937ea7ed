"""What one match has open outside the core: the publishers of its lane, two public ones, and its journal."""

from typing import Protocol

from arena.game.types import Team
from arena.network.session import Put, Session
from arena.pit.effects import Append, PublishEnding, PublishTick, Send
from arena.protocol import topics


def open_lane(session: Session, pit: str, lane: int) -> list[Put]:
    """Return what publishes to the two seats of a lane, as long as the session lives."""
    return [session.publisher(topics.observation(pit, lane, team))[0] for team in Team]


class OpenJournal(Protocol):
    """A journal that is being written."""

    def append(self, data: bytes) -> None:
        """Append to it; `ArenaError` if it cannot be written."""

    def close(self) -> None:
        """Close it as it stands."""


class MatchChannels:
    """Carries out the effects of one match."""

    def __init__(
        self, session: Session, pit: str, journal: OpenJournal, match: str, puts: list[Put], is_delayed_public: bool
    ) -> None:
        self._journal, self._puts = journal, puts
        self._public = session.broadcast(topics.public(pit, match))
        self._truth = session.broadcast(topics.truth(pit, match))
        self._past_truth = session.broadcast(topics.delayed(pit, match)) if is_delayed_public else None
        self._ends = [one.end for one in (self._public, self._truth, self._past_truth) if one is not None]

    def append(self, effect: Append) -> None:
        """Append to the journal; `ArenaError` if it cannot be written."""
        self._journal.append(effect.data)

    def send(self, effect: Send) -> None:
        """Send to a seat."""
        self._puts[effect.team](effect.payload)

    def publish_tick(self, effect: PublishTick) -> None:
        """Publish what somebody subscribed to."""
        for put, payload in self.make_tick(effect):
            put(payload)

    def make_tick(self, effect: PublishTick) -> list[tuple[Put, bytes]]:
        """Return what somebody subscribed to, to be published."""
        made = []
        if self._public.has_subscribers:
            made.append((self._public.put, effect.make_public()))
        if effect.make_truth is not None and self._truth.has_subscribers:
            made.append((self._truth.put, effect.make_truth()))
        if effect.make_past_truth is not None and self._past_truth is not None and self._past_truth.has_subscribers:
            made.append((self._past_truth.put, effect.make_past_truth()))
        return made

    def publish_ending(self, effect: PublishEnding) -> None:
        """Publish how the match ended."""
        self._public.put(effect.payload)

    def close(self) -> None:
        """Close all of it."""
        for end in self._ends:
            end()
        self._journal.close()
