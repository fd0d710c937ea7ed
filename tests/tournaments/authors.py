"""Seasons whose desks are open, and authors who submit to them, well or ill: for the tests of submissions."""

from collections.abc import Callable
from hashlib import sha256
from pathlib import Path
from typing import Any

from arena.game.ruleset import load
from arena.match.time_control import TimeControl
from arena.network.address import Address, free_port
from arena.network.asking import ask
from arena.network.session import Session, open_client
from arena.pit.register import Register
from arena.protocol import topics
from arena.protocol.codec import decode, encode
from arena.protocol.handshake import Attempt, read_challenge
from arena.protocol.identity import Identity
from arena.protocol.messages import ChallengeRequest, Message, Refusal, SeasonAnswer, SeasonRequest
from arena.submission import PIECE_BYTES, Submission
from tournaments.league.season import SeasonTerms
from tournaments.season.intake import CheckTerms, Intake
from tournaments.season.owners import OwnerRequests
from tournaments.season.submitted import SubmittedFolder
from tournaments.store.season_store import SeasonStore

SEASON = "course"
DEFINITION = {"ruleset": "paper", "rules": "1", "entries": {"rush": "rush"}, "clock": {}, "season": True, "secret": "s"}
BOT = b"def act(seen):\n    return [3] * len(seen.units)\n"


def pack(code: bytes = BOT) -> bytes:
    """Return a bot as `arena submit` packs it."""
    return Submission(kind="bot", main="bot.py", files={"bot.py": code}).pack()


class Season:
    """A season with its desk, without matches; its clock stands still."""

    def __init__(self, folder: Path, terms: SeasonTerms, invites: list[str] | None = None) -> None:
        self.folder, self.terms, self.now_s = folder, terms, 1_000_000.0
        self.identity = Identity.make()
        self.address = Address(endpoint=f"tcp/127.0.0.1:{free_port()}", pit=SEASON, fingerprint=self.identity.fingerprint)
        self.store = SeasonStore(str(folder / "arena.db"))
        self.row = self.store.open_season(SEASON, DEFINITION, self.now_s)
        self.submitted = SubmittedFolder(folder)
        self.logs = folder / "logs"
        self.logs.mkdir(exist_ok=True)
        self.on_submission: Callable[[], None] = lambda: None
        self.owners = OwnerRequests(
            self.store, self.row, terms, self.submitted, self.logs, Register(folder / "register.json", invites),
            clock=lambda: self.now_s, on_submission=self.announce,
        )  # fmt: skip

    def announce(self) -> None:
        self.on_submission()

    def intake(self, **changes: Any) -> Intake:
        """Return what checks submissions: against one opponent, in at most 3 s."""
        terms = CheckTerms(
            **{
                "ruleset": load("paper"), "time_control": TimeControl(turn_time_s=0.5, bank_s=0.5), "opponents": ("rush",),
                "most_s": 3.0, "patience_s": 20.0, "most_bytes": self.terms.most_kb * 1_000, **changes,
            }
        )  # fmt: skip
        return Intake(self.store, self.row, self.submitted, terms, clock=lambda: self.now_s)

    def kept(self) -> list[str]:
        """Return what lies in the folder of submissions."""
        return sorted(path.name for path in (self.folder / "submissions").iterdir())


class Author:
    """Somebody with a key and a connection."""

    def __init__(self, season: Season, name: str = "ann", identity: Identity | None = None) -> None:
        self.season, self.name, self.identity = season, name, identity or Identity.make()
        self.session: Session = open_client(season.address.endpoint)

    def send(self, payload: bytes) -> bytes:
        """Return what the desk answers to raw bytes."""
        return ask(self.session, self.season.address, topics.submissions(SEASON), payload)

    def attempt(self, request: SeasonRequest) -> Attempt:
        return Attempt(self.identity, SEASON, read_challenge(SEASON, self.send(encode(ChallengeRequest()))), request)

    def ask(self, command: str, **fields: Any) -> Message:
        """Return the answer to a request that is signed and sealed."""
        attempt = self.attempt(SeasonRequest(command=command, **{"name": self.name, **fields}))
        return attempt.open(self.send(attempt.sealed))

    def upload(self, data: bytes, **fields: Any) -> Message:
        """Send all pieces; return the last answer, or the first that is no progress."""
        offset = 0
        while True:
            piece = data[offset : offset + PIECE_BYTES]
            announced = {"digest": sha256(data).digest(), "n_bytes": len(data), **fields}
            answer = self.ask("upload", offset=offset, piece=piece, **announced)
            if not isinstance(answer, SeasonAnswer) or answer.offset <= offset or answer.offset == len(data):
                return answer
            offset = answer.offset


def refusal(answer: Message) -> str:
    """Return the sentence of a refusal."""
    assert isinstance(answer, Refusal), answer
    assert answer.reason.isprintable()
    return answer.reason


def read_refusal(data: bytes) -> str:
    """Return the sentence of a refusal that is not sealed."""
    return refusal(decode(data))
