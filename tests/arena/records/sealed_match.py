"""A match that was played in a pit, with every signature under its journal, for tests of what the signatures are worth."""

import random
from collections.abc import Callable
from dataclasses import dataclass, field, replace

from arena.annotations import read_annotations
from arena.game.keys import MatchKeys
from arena.game.ruleset import Ruleset, load
from arena.game.types import Action, Team
from arena.match.effects import Ask, Effect, Write
from arena.match.match import Match, Phase
from arena.match.time_control import TimeControl
from arena.protocol.identity import Identity
from arena.protocol.messages import Commitment, Receipt
from arena.protocol.signed import commit, sign_journal, sign_receipt, sign_statement
from arena.records.journal import (
    CHAIN_BYTES,
    MAGIC,
    Header,
    Journal,
    read_journal,
    write_receipt,
    write_seats,
    write_signature,
)
from arena.records.plan import network_name
from arena.records.transcript import Head, Transcript, TranscriptHeader

RULES = load("paper").with_({"side": 10, "tick_limit": 12})
UNITS = len(RULES.team(Team.BLUE))
PIT, STRANGER = Identity.make(), Identity.make()
ENTRIES = {team: Identity.make() for team in Team}
PUBLIC = {team: identity.public for team, identity in ENTRIES.items()}
KEYS = MatchKeys(map_key=b"\x07" * 32, match_key=b"\x08" * 32)
OTHER_KEYS = MatchKeys(map_key=b"\x07" * 32, match_key=b"\x09" * 32)
NO_CLOCK, CLOCK = TimeControl(turn_time_s=None), TimeControl(turn_time_s=1.0, bank_s=60.0)
Quirk = Callable[["Played", Team, int], bytes | None]


@dataclass
class Played:
    """A match between two seats that answer at random, and what each was shown and said."""

    time_control: TimeControl = NO_CLOCK
    identity: str = "pit/0/ann/bob"
    keys: MatchKeys = KEYS
    ruleset: Ruleset = RULES
    quirk: Quirk | None = None
    """What a seat answers instead of its orders at a tick; None keeps it silent until it is too late."""
    now_s: float = 0.0
    shown: dict[Team, list[bytes]] = field(default_factory=lambda: {team: [] for team in Team})
    said: dict[Team, list[bytes]] = field(default_factory=lambda: {team: [] for team in Team})

    def __post_init__(self) -> None:
        header = Header(identity=self.identity, blue="ann", red="bob", ruleset=self.ruleset, keys=self.keys)
        self.match, self.chance = Match(header, self.time_control, 0.0), random.Random(7)
        self.id = network_name(self.identity, b"", b"")
        self.plain = self.match.start_record
        for team in Team:
            self.carry_out(self.match.ready(team, 0.0))

    def carry_out(self, events: list[Effect]) -> None:
        for event in events:
            if isinstance(event, Ask):
                self.shown[event.team].append(event.observation)
            elif isinstance(event, Write):
                self.plain += event.data

    def submit(self, team: Team, orders: bytes | None) -> None:
        own = self.ruleset.team(team)
        self.said[team].append(orders or bytes(self.chance.randrange(len(Action)) for _ in own))
        if orders is not None:
            self.carry_out(self.match.submit(team, self.match.tick, orders, self.now_s))

    def tick(self) -> None:
        """Let both answer, each after some time of its own."""
        tick = self.match.tick
        for team in Team:
            own = bytes(self.chance.randrange(len(Action)) for _ in self.ruleset.team(team))
            self.now_s += self.chance.random() * 2
            self.submit(team, self.quirk(self, team, tick) if self.quirk else own)
        if self.match.phase is Phase.PLAYING and self.match.tick == tick:
            self.now_s += 1_000.0
            self.carry_out(self.match.advance(self.now_s))

    def play(self, n_ticks: int = 1_000) -> "Played":
        while n_ticks and self.match.phase is Phase.PLAYING:
            self.tick()
            n_ticks -= 1
        return self

    def receipt(
        self, team: Team, by: Identity | None = None, n_shown: int | None = None, shown: list[bytes] | None = None
    ) -> Receipt:
        """Return a seat's word on what it was shown, or on less, or on something else."""
        head = Head()
        counted = self.shown[team][:n_shown] if shown is None else shown
        for observation in counted:
            head.add(observation)
        return sign_receipt(by or ENTRIES[team], self.id, team, len(counted) if n_shown is None else n_shown, head.digest)

    def commitment(self, keys: MatchKeys, match: str = "", by: Identity = PIT) -> bytes:
        return sign_statement(by, Commitment(match=match or self.id, digest=commit(match or self.id, keys))).signature

    def journal(
        self,
        receipts: dict[Team, Receipt] | None = None,
        commitment: bytes | None = None,
        signature: bytes | None = None,
    ) -> Journal:
        """Return the journal as the pit writes it, or with other seals."""
        return read_journal(self.data(receipts, commitment, signature))

    def data(
        self,
        receipts: dict[Team, Receipt] | None = None,
        commitment: bytes | None = None,
        signature: bytes | None = None,
    ) -> bytes:
        """Return the bytes of `journal`."""
        begin = len(MAGIC) + 5 + len(self.match.header.pack()) + CHAIN_BYTES
        seats = write_seats(PIT.public, PUBLIC, self.commitment(self.keys) if commitment is None else commitment)
        data = self.plain[:begin] + seats + self.plain[begin:]
        for team, receipt in ({team: self.receipt(team) for team in Team} if receipts is None else receipts).items():
            data += write_receipt(team, receipt)
        signed = sign_journal(PIT, self.match.head) if signature is None else signature
        return data + (write_signature(signed) if signed else b"")

    def transcript(self, team: Team) -> Transcript:
        header = TranscriptHeader(
            match=self.id,
            pit="pit",
            pit_key=PIT.public,
            entry_key=PUBLIC[team],
            name="ann",
            opponent="bob",
            team=team,
            ruleset=self.ruleset,
            commitment=commit(self.id, self.keys),
        )
        result = self.match.result
        if result is not None and team is Team.RED:
            result = replace(result, score=-result.score)
        ticks = list(zip(self.shown[team], self.said[team], strict=False))
        n_ticks = len(ticks)
        notes = [read_annotations(b"", header.ruleset.side)] * n_ticks
        return Transcript(
            header=header, ticks=ticks, charges_us=[None] * n_ticks, annotations=notes, ending=result, is_whole=True
        )  # fmt: skip
