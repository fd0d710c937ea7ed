"""Keys that are no secret, and one or two messages of each kind: what the tests of the protocol's bytes speak of."""

from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey
from cryptography.hazmat.primitives.asymmetric.x25519 import X25519PrivateKey

from arena.game.ruleset import load, to_dict
from arena.protocol.identity import Identity
from arena.protocol.messages import (
    AdminRequest,
    Bundle,
    Challenge,
    ChallengeRequest,
    Closed,
    Commitment,
    Done,
    Ended,
    History,
    JoinRequest,
    JournalPiece,
    JournalRequest,
    Lobby,
    Message,
    Orders,
    PastTruth,
    PublicState,
    Ready,
    Receipt,
    Refusal,
    SealedAnswer,
    SealedRequest,
    SeasonAnswer,
    SeasonRequest,
    Signed,
    Ticket,
    Truth,
    Turn,
    Wait,
)

PIT, ANN, BOB = (Identity(Ed25519PrivateKey.from_private_bytes(bytes([number]) * 32)) for number in (1, 2, 3))
SEALING = X25519PrivateKey.from_private_bytes(bytes([4]) * 32)
A, B, C = (bytes(range(start, start + 32)) for start in (0, 32, 64))
SIGNATURE = bytes(range(64))
MATCH = "0123456789abcdef"
PAPER = {"name": "paper", **to_dict(load("paper"))}
MESSAGES: dict[str, tuple[Message, ...]] = {
    "a client asks for the keys": (ChallengeRequest(),),
    "the keys": (Challenge(pit_key=A, sealing_key=B, number=C, signature=SIGNATURE),),
    "a sealed request": (SealedRequest(sealed=b"\x00sealed\xff"), SealedRequest(sealed=bytes(300))),
    "a sealed answer": (SealedAnswer(sealed=b"\x00sealed\xff"),),
    "a request for a seat": (
        JoinRequest(rules_version=1, name="ann", team="any", client="c-1", slot=0),
        JoinRequest(
            rules_version=2, name="böb", team="red", client="c_2", slot=255, rules_hash="5" * 64, match=MATCH, invite="code",
            entry=A, ephemeral=B, reply_secret=C, challenge=A, pit_key=B,
        ),
        JoinRequest(rules_version=1, name="ann", team="any", client="c-1", slot=1, bundles=True),
    ),
    "the operator's request": (
        AdminRequest(command="close", target=""),
        AdminRequest(command="kick", target="ann", entry=A, ephemeral=B, reply_secret=C, challenge=A, pit_key=B),
    ),
    "the operator's answer": (Done(text="ann was sent away"),),
    "a seat": (
        Ticket(
            match=MATCH, lane=0, team=0, ruleset={}, opponent="bob", turn_time_s=1.0, bank_s=10.0, tick=0, secret=A,
            commitment=b"c",
        ),
        Ticket(
            match=MATCH, lane=999_999, team=1, ruleset=PAPER, opponent="ann", turn_time_s=None, bank_s=0.125, tick=99, secret=B,
            commitment=b"c" * 200,
        ),
        Ticket(
            match=MATCH, lane=0, team=0, ruleset={}, opponent="bob", turn_time_s=1.0, bank_s=10.0, tick=0, secret=A,
            commitment=b"c", public_delay=20,
        ),
        Ticket(
            match=MATCH, lane=0, team=0, ruleset={}, opponent="bob", turn_time_s=1.0, bank_s=10.0, tick=0, secret=A,
            commitment=b"c", bundle_lane=999_999,
        ),
    ),
    "no seat yet": (Wait(reason="no opponent yet"),),
    "no seat": (Refusal(reason="the name is another's"),),
    "no more matches": (Closed(reason="all is played"),),
    "a seat listens": (Ready(known_ticks=0), Ready(known_ticks=300)),
    "an observation": (
        Turn(tick=0, observation=b""),
        Turn(tick=70_000, observation=bytes(range(256)), charged_us=1_250_000),
    ),
    "what was missed": (
        History(first_tick=0, observations=[], orders=[], end_tick=0),
        History(first_tick=3, observations=[b"one", b"two"], orders=[b"\x01\x02", b"\x00\xff"], end_tick=9),
    ),
    "orders": (Orders(tick=0, actions=b""), Orders(tick=12, actions=b"\x00\x01\x02\x03\x04\xff")),
    "a signed message": (Signed(data=b"data", signature=SIGNATURE),),
    "the commitment to a match's keys": (Commitment(match=MATCH, digest=C),),
    "an ending": (
        Ended(match=MATCH, ending="tick_limit", winner=None, score=0, ticks=100, reason=""),
        Ended(
            match=MATCH, ending="forfeit", winner="blue", score=-100, ticks=7, reason="red vanished",
            faults={"blue": {"late": 0}, "red": {"late": 3, "vanished": 1}},
        ),
    ),
    "a receipt": (Receipt(n_shown=101, head=A, signature=SIGNATURE),),
    "public facts": (PublicState(tick=5, names=["ann", "bob"], living=[6, 4], score=-20, commitment=b"c"),),
    "the truth": (Truth(tick=5, board=bytes(range(9)), seen=[b"blue", b"red"]),),
    "the truth of a while ago": (PastTruth(match=MATCH, tick=5, board=bytes(range(9)), seen=[b"blue", b"red"]),),
    "a request for a journal": (JournalRequest(offset=0), JournalRequest(offset=1 << 20)),
    "a piece of a journal": (JournalPiece(n_bytes=5_000_000_000, offset=7, data=b"piece"),),
    "a request to a season": (
        SeasonRequest(command="status", name="ann"),
        SeasonRequest(
            command="upload", name="ann", invite="code", digest=A, n_bytes=70_000, offset=48_000, piece=b"piece", number=2,
            entry=A, ephemeral=B, reply_secret=C, challenge=A, pit_key=B,
        ),
    ),
    "a season's answer": (
        SeasonAnswer(text="it waits for its check"),
        SeasonAnswer(text="version 2 plays", offset=5, data=b"a line", facts={"versions": [{"number": 2, "rating": 31.5}]}),
    ),
    "messages of several seats": (
        Bundle(seats=[], messages=[]),
        Bundle(seats=[14, 15, 1_999_999], messages=[b"sealed", b"", bytes(300)]),
    ),
    "the lobby": (
        Lobby(
            pit="pit", rules="paper", rules_hash="5" * 64, ruleset=PAPER, needs_invite=False, n_begun=0, running=[], waiting=[]
        ),
        Lobby(
            pit="p-2", rules="own", rules_hash="6" * 64, ruleset={"side": 4, "board": None}, needs_invite=True, n_begun=12,
            running=[{"match": MATCH, "blue": "ann", "red": "bob", "tick": 3}], waiting=["cid"],
            standings=[
                {"name": "ann", "rating": 12.5, "mu": 25.0, "sigma": 8.25, "wins": 1, "draws": 0, "losses": 2, "forfeits": 0}
            ],
        ),
    ),
}  # fmt: skip
