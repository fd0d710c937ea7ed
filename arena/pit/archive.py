"""The journals of matches that are over, for whoever asks, once they may be seen. Without I/O."""

from collections import OrderedDict
from collections.abc import Callable

from arena.errors import ProtocolError
from arena.pit.effects import Drop, Effect, Reply, ReplyWithJournal
from arena.pit.events import JournalAsked
from arena.pit.rationed_queue import RationedQueue
from arena.protocol.codec import decode, encode
from arena.protocol.messages import JournalRequest, Message, Refusal, Wait
from arena.records.journal import Header, journal_name

MOST_KEPT = 10_000
"""Matches that are remembered; the journals of older ones are on the disk alone."""
_SHARE = 0.1
"""Of the time that goes to pieces of journals, while matches run."""
_MOST_DEBT_S = 0.5
_MOST_ASKED = 16
"""Questions for one journal that wait until it is whole."""


class Archive:
    """Answers questions about journals.

    Parameters
    ----------
    is_fixture_over
        Whether all matches of two entries, by name, are over.
    """

    def __init__(self, is_fixture_over: Callable[[set[str]], bool]) -> None:
        self._is_fixture_over = is_fixture_over
        self._headers: OrderedDict[str, Header] = OrderedDict()
        self._asked: dict[str, list[JournalAsked]] = {}
        """By match whose journal will be whole in a moment."""
        self.replies: RationedQueue[ReplyWithJournal] = RationedQueue(share=_SHARE, most_debt_s=_MOST_DEBT_S)
        """Pieces that are to be sent."""

    def expect(self, match: str) -> None:
        """Let those who ask for a journal wait until it is added."""
        self._asked[match] = []

    def add(self, match: str, header: Header | None) -> list[Effect]:
        """Keep a journal that is whole, None if the match left none, and answer those who wait for it."""
        if header is not None:
            self._headers[match] = header
        if len(self._headers) > MOST_KEPT:
            self._headers.popitem(last=False)
        return [effect for asked in self._asked.pop(match, []) for effect in self.answer(asked)]

    def answer(self, asked: JournalAsked) -> list[Effect]:
        """Say why there is no piece, or let it be sent when there is time."""
        waiting = self._asked.get(asked.match)
        if waiting is not None and len(waiting) < _MOST_ASKED:
            waiting.append(asked)
            return []
        try:
            request = decode(asked.payload)
        except ProtocolError as error:
            return _reply(asked, Refusal(reason=f"the request cannot be read: {error}"))
        if not isinstance(request, JournalRequest) or request.offset < 0:
            return _reply(asked, Refusal(reason="this is no request for a journal"))
        header = self._headers.get(asked.match)
        if header is None:
            return _reply(asked, Refusal(reason=f"there is no journal of a match {asked.match}, or the match is not over"))
        if not self._is_fixture_over({header.blue, header.red}):
            return _reply(asked, Wait(reason="until the last match of these two is over"))
        reply = ReplyWithJournal(asked.question, journal_name(header.identity), request.offset)
        return [] if self.replies.put(reply) else [Drop(asked.question)]


def _reply(asked: JournalAsked, message: Message) -> list[Effect]:
    return [Reply(asked.question, encode(message))]
