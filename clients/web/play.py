"""A person who plays in the browser: a seat of their own, that outlives the page as long as its match does.

The seat's runner has its thread, as `arena join` has its process. What the page is sent is what the terminal shows, a
`clients.human.view_model.ViewModel` as plain data; what it says goes to the same `Commander`.
"""

import asyncio
import logging
import secrets
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from typing import Any

from arena.display.frame import to_text
from arena.errors import ArenaError, InputError, UnknownNameError
from arena.game.types import Action
from clients.audit import Verdict
from clients.human.commander import Commander
from clients.human.turn_mailbox import TurnMailbox
from clients.human.view_model import ViewModel
from clients.runner import Runner
from clients.seat import Seat
from clients.settings import ClientSettings
from policies import registry

logger = logging.getLogger(__name__)

MOST_PLAYERS = 16
"""Who hold or want a seat at once."""
_TOKEN_BYTES = 16


@dataclass(frozen=True, slots=True, kw_only=True)
class Wish:
    """What a person asks for."""

    name: str
    team: str
    opponent: str = ""
    """A fighter to sit down on the other side; empty waits for whoever comes."""
    invite: str = ""


class BrowserSeat:
    """One person, in one match."""

    def __init__(self, wish: Wish, settings: ClientSettings, opponent: ClientSettings | None) -> None:
        self.token = secrets.token_urlsafe(_TOKEN_BYTES)
        """Known to the page that asked for the seat, and to no other."""
        self.wish = wish
        self.mailbox = TurnMailbox()
        self.is_over = False
        """Whether the runner has ended; nothing changes after that."""
        self._failure = ""
        self._verdict = ""
        self._pages: set[Callable[[], None]] = set()
        self.mailbox.on_change = self._on_change
        own = replace(settings, make=self.mailbox.make, is_patient=True, n_matches=1, on_audit=self._hear_verdict)
        self._runner = Runner(own, on_seat=self.mailbox.on_seat, on_end=lambda _: None, on_wait=self.mailbox.on_wait)
        self.mailbox.wake = self._runner.wake
        self._runners = [self._runner]
        if opponent is not None:
            self._runners.append(Runner(opponent, on_seat=_ignore, on_end=_ignore, on_wait=_ignore))
        self._threads = [threading.Thread(target=self._run, args=(runner,), daemon=True) for runner in self._runners]
        for thread in self._threads:
            thread.start()

    @contextmanager
    def watch(self, loop: asyncio.AbstractEventLoop, changed: asyncio.Event) -> Iterator[None]:
        """Set an event of a loop whenever there is something new to show."""

        def notify() -> None:
            with suppress(RuntimeError):  # the server has ended
                loop.call_soon_threadsafe(changed.set)

        self._pages.add(notify)
        try:
            yield
        finally:
            self._pages.discard(notify)

    def _on_change(self) -> None:
        for notify in list(self._pages):
            notify()

    def leave(self) -> None:
        """Give the seat up; the pit waits as long for it as for any that vanished."""
        for runner in self._runners:
            runner.stop()

    def wait(self, limit_s: float) -> None:
        """Wait until the seat is given up."""
        for thread in self._threads:
            thread.join(limit_s)

    def to_json(self) -> dict[str, Any]:
        """Return all that the page shows now."""
        mailbox = self.mailbox
        with mailbox.lock:
            picture, result = mailbox.view_model(), mailbox.result
            shown: dict[str, Any] = {
                "kind": "failed" if self._failure else "over" if result else "turn" if picture else "waiting",
                "name": self.wish.name,
                "sentence": self._failure or mailbox.waiting_for,
                "match": mailbox.match,
                "opponent": mailbox.opponent,
                "autopilot": mailbox.autopilot,
                "verdict": self._verdict,
                "is_my_turn": mailbox.is_my_turn,
            }
            if picture is not None and mailbox.commander is not None:
                shown["picture"] = _describe(picture)
            if result is not None:
                shown["result"] = result.to_dict()
                shown["team"] = None if mailbox.commander is None else int(mailbox.commander.team)
        return shown

    def do(self, word: Any) -> None:
        """Carry out what the page says; `InputError` if that is nothing that it can say."""
        act = _read_word(word)
        if act is None:
            self.mailbox.end_turn()
        else:
            self.mailbox.command(act)
        self._on_change()

    def fly_by(self, autopilot: str) -> None:
        """Choose another autopilot; takes a moment, so not for the loop of the server."""
        self.mailbox.set_autopilot(autopilot)
        self._on_change()

    def _run(self, runner: Runner) -> None:
        who = self.wish.name if runner is self._runner else self.wish.opponent
        try:
            runner.run()
        except ArenaError as error:
            self._failure = self._failure or f"{who}: {error}"
        except Exception:
            logger.exception("the seat of %s ended", who)
            self._failure = f"the seat of {who} ended by a fault of this program; its log says which"
        finally:
            self.is_over = self.is_over or runner is self._runner
            if self._failure:
                self.leave()  # neither waits for the other
            self._on_change()

    def _hear_verdict(self, _: Seat, verdict: Verdict) -> None:
        self._verdict = verdict[1]
        self._on_change()


def _ignore(_: object) -> None:
    """Hear what nobody needs to know."""


class BrowserSeats:
    """Everyone who plays by this server.

    Parameters
    ----------
    settings
        What a runner is shown of an entry, by its name, its team and its invite code; `InputError` if it cannot be.
    """

    def __init__(self, settings: Callable[[str, str, str], ClientSettings]) -> None:
        self._settings = settings
        self._players: dict[str, BrowserSeat] = {}

    def sit_down(self, wish: Wish) -> BrowserSeat:
        """Look for a seat for a person."""
        if sum(not player.is_over for player in self._players.values()) >= MOST_PLAYERS:
            raise InputError(f"{MOST_PLAYERS} people play here already; come back when one has finished")
        for token in [token for token, player in self._players.items() if player.is_over][:-MOST_PLAYERS]:
            del self._players[token]  # the last of them may still be looked at
        own, other = self._settings(wish.name, wish.team, wish.invite), None
        if wish.opponent:
            across = {"red": "blue", "blue": "red"}.get(wish.team, "any")
            across_settings = self._settings(wish.opponent, across, wish.invite)
            other = replace(across_settings, make=registry.load(wish.opponent), transcripts=None)
        player = BrowserSeat(wish, own, other)
        self._players[player.token] = player
        return player

    def find(self, token: object) -> BrowserSeat | None:
        """Return who was given a token."""
        return self._players.get(token) if isinstance(token, str) else None

    def close(self, limit_s: float) -> None:
        """Give all seats up."""
        for player in self._players.values():
            player.leave()
        for player in self._players.values():
            player.wait(limit_s)


def read_wish(message: dict[str, Any]) -> Wish:
    """Return what a page asks for; `InputError` if it is nothing that can be had."""
    fields = {name: message.get(name, "") for name in ("name", "team", "opponent", "invite")}
    if not all(isinstance(value, str) for value in fields.values()):
        raise InputError("name, team, opponent and invite must be text")
    if fields["team"] not in ("red", "blue", "any"):
        raise InputError(f"the team is {fields['team']!r}; it must be red, blue or any")
    check_fighter(fields["opponent"])
    return Wish(**fields)


def check_fighter(name: object) -> str:
    """Return the name of a fighter that ships, or none; a page may not name files and programs of this machine."""
    if name not in ("", *registry.names()):
        raise UnknownNameError("fighter", str(name), registry.names())
    return str(name)


def _read_word(word: Any) -> Callable[[Commander], object] | None:
    """Return what a word of the page does to the commander; None if it ends the turn."""
    match word:
        case {"do": "end"}:
            return None
        case {"do": "select", "unit": int(unit)}:
            return lambda commander: commander.select(unit)
        case {"do": "next", "by": 1 | -1 as by}:
            return lambda commander: commander.select_next(by)
        case {"do": "order", "action": int(action)} if action in tuple(Action):
            return lambda commander: commander.order(Action(action))
        case {"do": "point", "row": int(row), "column": int(column)}:
            return lambda commander: commander.point(row, column)
        case {"do": "release"}:
            return lambda commander: commander.release()
    raise InputError("the page said what no person can do")


def _describe(picture: ViewModel) -> dict[str, Any]:
    """Return a picture as plain data."""
    return {
        "tick": picture.tick,
        "tick_limit": picture.tick_limit,
        "side": len(picture.grid),
        "team": int(picture.team),
        "score": picture.score,
        "living": list(picture.living),
        "time_left_s": picture.time_left_s,
        "grid": to_text(picture.grid),
        "known": to_text(picture.known),
        "units": [
            {
                "type": unit.type,
                "cell": list(unit.cell),
                "alive": unit.alive,
                "sight": unit.sight,
                "attack": unit.attack,
                "reach": unit.reach,
                "order": unit.order,
                "action": unit.action.name.lower(),
                "route": [list(cell) for cell in unit.route],
                "is_fresh": unit.is_fresh,
            }
            for unit in picture.units
        ],
        "selected": picture.selected,
        "options": [
            {
                "action": int(one.action),
                "name": one.action.name.lower(),
                "to": list(one.to),
                "is_open": one.is_open,
                "why": one.why,
            }
            for one in picture.options
        ],
        "is_complete": picture.is_complete,
    }
