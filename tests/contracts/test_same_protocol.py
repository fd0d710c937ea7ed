"""What goes over the network, and into files, has the bytes that it had: an old client, journal or transcript is understood."""

import json
import re
from collections.abc import Callable
from hashlib import sha256
from inspect import getmodule, isfunction
from pathlib import Path
from typing import get_args

import pytest
from protocol_examples import ANN, BOB, MATCH, MESSAGES, PIT, SEALING, SIGNATURE, A, B, C

from arena.errors import ArenaError
from arena.game.keys import (
    MatchKeys,
    derive_map_key,
    derive_match_key,
    expand,
    philox_keys,
    secret_from_seed,
)
from arena.game.ruleset import Ruleset, load, to_dict
from arena.game.types import Team
from arena.policy import MatchResult
from arena.protocol.codec import MOST_BYTES, decode, encode
from arena.protocol.handshake import Attempt, check_challenge, open_request, sign_challenge
from arena.protocol.identity import from_text, to_text, verify
from arena.protocol.messages import (
    PROTOCOL_VERSION,
    Commitment,
    Ended,
    JoinRequest,
    Lobby,
    Message,
)
from arena.protocol.sealing import (
    Direction,
    Opener,
    Sealer,
    derive_key,
    pad,
    seat_context,
    truth_opener,
    truth_sealer,
)
from arena.protocol.signed import check_journal, check_receipt, commit, read_statement, sign_journal, sign_receipt, sign_statement
from arena.protocol.topics import (
    action,
    actions_of_worker,
    all_actions,
    all_delayed,
    all_journals,
    all_observations,
    all_presence,
    all_public,
    all_truths,
    beat,
    beat_of_worker,
    check_chunk,
    check_label,
    delayed,
    is_chunk,
    is_label,
    join,
    journal,
    lanes_of_worker,
    lobby,
    observation,
    presence,
    public,
    read_action,
    read_journal,
    read_match,
    read_presence,
    submissions,
    truth,
)
from arena.records.journal import (
    Journal,
    journal_name,
    write_receipt,
    write_seats,
    write_signature,
)
from arena.records.journal import read_journal as read_journal_bytes
from arena.records.plan import network_name
from arena.records.transcript import (
    Head,
    TranscriptHeader,
    TranscriptWriter,
    load_transcript,
    transcript_name,
)
from arena.records.verification import check_seals, compare, watch

Same = Callable[[str, str], None]
UNREADABLE = (
    b"", b"\xc1", b"\x93", b"\x90", b"\x93\x04\xa1a", b"\x92\x03\x00", b"\x92\x04\x63", b"\x92\x04\x01", b"\x93\x04\x02\xa1a",
    b"\x94\x04\x02\xc4\x01a\x01", bytes(MOST_BYTES + 1),
)  # fmt: skip
"""As version 4 reads them: none, no msgpack, cut short, of another version, of no kind, of other fields."""


def say(check: Callable[..., object], *arguments: object) -> str:
    """Return what a call gave, or the sentence with which it refused."""
    try:
        found = check(*arguments)
    except ArenaError as error:
        return f"exit {error.exit_code}: {name_kinds(str(error))}"
    if isinstance(found, tuple):
        return " ".join(one.name if isinstance(one, Team) else str(one) for one in found)
    return found.hex() if isinstance(found, bytes) else str(found)


def name_kinds(sentence: str) -> str:
    """Return a sentence with a message's class called as it is here: a class may be renamed, and its bytes stay."""
    for name, messages in MESSAGES.items():
        sentence = re.sub(rf"\b{type(messages[0]).__name__}\b", f"({name})", sentence)
    return sentence


# Messages


def test_every_message_has_the_bytes_of_before(same: Same) -> None:
    told = {name: [encode(message).hex() for message in messages] for name, messages in MESSAGES.items()}

    same("messages.json", json.dumps({"version": PROTOCOL_VERSION, **told}, indent=1) + "\n")


@pytest.mark.parametrize("name", MESSAGES)
def test_every_message_is_read_back(name: str) -> None:
    assert tuple(decode(encode(message)) for message in MESSAGES[name]) == MESSAGES[name]


def test_no_kind_of_message_is_left_out() -> None:
    kinds = {type(message) for messages in MESSAGES.values() for message in messages}

    assert kinds == set(get_args(Message))


def test_bytes_that_are_no_message_are_refused_in_the_words_of_before(same: Same) -> None:
    lines = [f"{data[:8].hex() or '-'} {say(decode, data)}" for data in UNREADABLE]

    same("unreadable.txt", "\n".join([*lines, ""]))


# Keys, topics and names


def test_the_keys_of_the_network_are_those_of_before(same: Same) -> None:
    seat_topics, match_topics = (observation, action), (public, truth, journal, delayed)
    pit_topics = (
        join,
        lobby,
        submissions,
        beat,
        all_observations,
        all_actions,
        all_public,
        all_truths,
        all_journals,
        all_presence,
        all_delayed,
    )
    worker_topics = (actions_of_worker, beat_of_worker)
    readers = (read_action, read_match, read_journal, read_presence)
    told = [topic("pit", 7, team) for topic in seat_topics for team in (*Team, None)]
    told += [topic("pit", MATCH) for topic in match_topics]
    told += [topic("pit") for topic in pit_topics]
    told += [presence("pit", "ann", "c-1")]
    told += [topic("pit", worker) for topic in worker_topics for worker in (1, 64)]
    told += [str(lanes_of_worker(worker)) for worker in (1, 64)]
    for key in (*told, "arena/pit/lane/7/green/action", "arena", ""):
        told.append(f"{key or '-'}: {[say(read, key) for read in readers]}")
    for chunk in ("ann", "a/b", "*", "", "a" * 64, "a" * 65, "böb"):
        told.append(f"{chunk or '-'}: {is_chunk(chunk)} {say(check_chunk, 'the name', chunk)}")
    for label in ("ann.2", "ann.20", "ann.1", "ann.02", "ann.x", "ann.2.2"):
        told.append(f"{label}: {is_chunk(label)} {is_label(label)} {say(check_label, 'the name', label)}")

    module = getmodule(observation)
    every = {one for one in vars(module).values() if isfunction(one) and getmodule(one) is module}
    assert every <= {
        *seat_topics, *match_topics, *pit_topics, *worker_topics, *readers,
        presence, lanes_of_worker, is_chunk, check_chunk, is_label, check_label,
    }  # fmt: skip
    same("topics.txt", "\n".join([*told, ""]))


def test_the_keys_of_a_match_follow_from_a_seed_as_before(same: Same) -> None:
    lines = []
    for seed in (0, 7, 2**53):
        secret = secret_from_seed(seed)
        match_key = derive_match_key(secret, "league/a/b/0003/a-blue/0")
        map_key = derive_map_key(secret, "league/a/b", 3)
        lines += [one.hex() for one in (secret, map_key, match_key, expand(match_key, "moves"))]
        lines += [str(one[0].tolist()) for one in philox_keys([MatchKeys(map_key=map_key, match_key=match_key)])]

    same("keys.txt", "\n".join([*lines, ""]))


def test_files_and_matches_are_called_as_before(same: Same) -> None:
    identities = ("pit/0", "league/a/b/0003/a-blue/0", "a+b", "ä b/%2F/..")
    before, now = (b"", b""), (A, A[:16])
    lines = [f"{network_name(one, *before)} {journal_name(one)}" for one in identities]
    lines += [network_name(one, *now) for one in identities]
    lines += [transcript_name(pit, match, team) for pit, match in (("pit", MATCH), ("p+/", "ä")) for team in Team]

    same("names.txt", "\n".join([*lines, ""]))


# Signatures and seals


def test_signatures_are_those_of_before(same: Same) -> None:
    keys = MatchKeys(map_key=A, match_key=B)
    challenge = sign_challenge("pit", PIT, SEALING.public_key().public_bytes_raw(), C)
    commitment = Commitment(match=MATCH, digest=commit(MATCH, keys))
    [*_, lobby_of_pit] = MESSAGES["the lobby"]
    [*_, ending] = MESSAGES["an ending"]
    assert isinstance(lobby_of_pit, Lobby)
    assert isinstance(ending, Ended)
    receipts = {team: sign_receipt(who, MATCH, team, 101, C) for team, who in zip(Team, (ANN, BOB), strict=True)}
    signed = [sign_statement(PIT, fact) for fact in (commitment, ending, lobby_of_pit)]

    check_challenge("pit", challenge)
    verify(PIT.public, "label", b"data", PIT.sign("label", b"data"))
    assert [read_statement(one, PIT.public) for one in signed] == [commitment, ending, lobby_of_pit]
    for (team, receipt), who in zip(receipts.items(), (ANN, BOB), strict=True):
        check_receipt(who.public, MATCH, team, receipt)
    check_journal(PIT.public, C, sign_journal(PIT, C))
    assert from_text(PIT.fingerprint) == PIT.public
    told = {
        "public keys": [who.fingerprint for who in (PIT, ANN, BOB)] + [to_text(A)],
        "a signature": PIT.sign("label", b"data").hex(),
        "a challenge": encode(challenge).hex(),
        "a digest of a match's keys": commitment.digest.hex(),
        "signed facts": [one.signature.hex() for one in signed],
        "receipts": [encode(one).hex() for one in receipts.values()],
        "a journal": sign_journal(PIT, C).hex(),
        "refused": [
            say(verify, ANN.public, "label", b"data", PIT.sign("label", b"data")),
            say(verify, bytes(32), "label", b"data", SIGNATURE),
            say(from_text, "short"),
            say(check_receipt, ANN.public, MATCH, Team.RED, receipts[Team.BLUE]),
            say(read_statement, signed[0], ANN.public),
        ],
    }
    same("signatures.json", json.dumps(told, indent=1) + "\n")


def test_seals_under_one_key_are_those_of_before(same: Same) -> None:
    told: dict[str, object] = {
        "derived keys": [derive_key(A, "seat").hex(), derive_key(A, "seat", b"one", b"", b"two").hex()],
        "padding": [pad(data, multiple).hex() for data, multiple in ((b"", 4), (b"abc", 4), (b"abcd", 4), (b"\x80\x00", 16))],
    }
    for team in Team:
        for direction in Direction:
            context = seat_context("pit", MATCH, team, direction)
            sealer, opener = Sealer(B, context), Opener(B, context)
            sealed = [sealer.close(data, tick) for data, tick in ((b"", 0), (b"orders", 1), (b"x" * 64, 70_000))]
            assert [opener.open(one) for one in sealed] == [b"", b"orders", b"x" * 64]
            told[f"{team.name.lower()} {direction.value}"] = [context.decode(), *(one.hex() for one in sealed)]
    wide = Sealer(B, b"context", 256).close(b"an observation", 3)
    sealed_truth = truth_sealer(A, C, "pit", MATCH).close(b"the truth", 4)
    assert truth_opener(A, C, "pit", MATCH).open(sealed_truth) == b"the truth"
    told |= {"wide": wide.hex(), "truth": sealed_truth.hex()}
    opener = truth_opener(A, C, "pit", MATCH)
    changed = bytes([*sealed_truth[:-1], sealed_truth[-1] ^ 1])
    told["refused"] = [say(opener.open, data) for data in (b"short", changed, sealed_truth, changed)]

    same("seals.json", json.dumps(told, indent=1) + "\n")


def test_a_request_that_was_sealed_before_is_opened_and_gives_the_same_keys_of_a_seat(
    same: Same, recorded: Callable[[str, Callable[[], str]], str]
) -> None:
    """What is sealed to a public key is another at each time; so this one was kept."""
    challenge = sign_challenge("pit", PIT, SEALING.public_key().public_bytes_raw(), C)
    request = JoinRequest(rules_version=1, name="ann", team="any", client="c-1", slot=0)

    def knock() -> str:
        return Attempt(ANN, "pit", challenge, request).sealed.hex()

    caller = open_request(bytes.fromhex(recorded("knock.hex", knock)), "pit", PIT.public, SEALING)
    told = [encode(caller.request).hex()]
    for team in Team:
        sealer, _ = caller.sit(MATCH, team, B, 128)
        told += [sealer.close(data, tick).hex() for tick, data in enumerate((b"one", b"two"))]

    assert caller.request.entry == ANN.public
    same("seat_keys.txt", "\n".join([*told, ""]))


# Files


def seal(small: Journal, data: bytes) -> bytes:
    """Return a journal as a pit on the network writes it."""
    match, shown = small.name, watch(small)
    commitment = sign_statement(PIT, Commitment(match=match, digest=commit(match, small.header.keys))).signature
    begin = data.index(small.start_chain) + len(small.start_chain)
    receipts = b""
    for team, who in zip(Team, (ANN, BOB), strict=True):
        head = Head()
        for one in shown[team]:
            head.add(one)
        receipts += write_receipt(team, sign_receipt(who, match, team, len(shown[team]), head.digest))
    seats = write_seats(PIT.public, {Team.BLUE: ANN.public, Team.RED: BOB.public}, commitment)
    assert small.ending_chain is not None
    return data[:begin] + seats + data[begin:] + receipts + write_signature(sign_journal(PIT, small.ending_chain))


def test_a_sealed_journal_has_the_bytes_of_before_and_holds(small: Journal, small_journal: bytes, same: Same) -> None:
    data = seal(small, small_journal)

    sealed = read_journal_bytes(data)
    checked = check_seals(sealed)

    assert checked is not None
    assert checked.is_sound
    assert (sealed.canonical, sealed.canonical_hash) == (small_journal, small.canonical_hash)
    standings = [checked.commitment.value, checked.signature.value, *(one.value for one in checked.receipts.values())]
    same("sealed_journal.hex", "\n".join([*standings, sealed.canonical_hash, data.hex("\n", 32), ""]))


@pytest.mark.parametrize("team", Team, ids=lambda team: team.name.lower())
def test_a_transcript_has_the_bytes_of_before(team: Team, small: Journal, same: Same, tmp_path: Path) -> None:
    header = TranscriptHeader(
        match=small.name, pit="pit", pit_key=PIT.public, entry_key=ANN.public, name="ann", opponent="bob",
        team=team, ruleset=small.header.ruleset, commitment=commit(small.name, small.header.keys),
    )  # fmt: skip
    path = tmp_path / "kept.transcript"
    n_blue = len(small.header.ruleset.team(Team.BLUE))
    own = slice(0, n_blue) if team is Team.BLUE else slice(n_blue, None)
    with TranscriptWriter(path, header) as transcript:
        for seen, tick in zip(watch(small)[team], small.ticks, strict=False):
            transcript.add(seen, tick.orders[own])
        assert small.ending is not None
        score = small.ending.score if team is Team.BLUE else -small.ending.score
        transcript.end(MatchResult(ending=small.ending.ending, winner=small.ending.winner, score=score, ticks=small.ending.ticks))

    read = load_transcript(path)

    assert compare(small, read) == ""
    same(f"transcript_{team.name.lower()}.hex", f"{read.head.hex()}\n{path.read_bytes().hex(chr(10), 32)}\n")


def test_a_header_of_every_rule_has_the_bytes_of_before(small_rules: Ruleset, same: Same) -> None:
    lines = []
    for rules in (load("paper"), load("gym-cap"), load("exp1"), load("mirror"), small_rules):
        header = TranscriptHeader(
            match=MATCH, pit="pit", pit_key=A, entry_key=B, name="ann", opponent="bob", team=Team.RED, ruleset=rules, commitment=C
        )
        assert TranscriptHeader.unpack(header.pack()) == header
        lines.append(f"{rules.name} {rules.hash} {sha256(header.pack()).hexdigest()} {json.dumps(to_dict(rules))}")

    same("headers.txt", "\n".join([*lines, ""]))
