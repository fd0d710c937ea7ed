"""Keys: RFC 5869 by another's hand, labels that tell nothing of each other, and legs that share a map."""

from collections.abc import Callable

import numpy as np
import pytest
from cryptography.hazmat.primitives.hashes import SHA256
from cryptography.hazmat.primitives.kdf.hkdf import HKDFExpand
from hypothesis import given
from hypothesis import strategies as st

from arena.game.engine import BatchedGame
from arena.game.keys import (
    MatchKeys,
    derive_map_key,
    derive_match_key,
    expand,
    new_secret,
    philox_keys,
    secret_from_seed,
)
from arena.game.ruleset import load
from arena.game.state import StateField
from arena.game.types import Team

KEYS = st.binary(min_size=32, max_size=32)
LABELS = ("moves", "fights", "blue seed", "red seed", "board")


@given(KEYS, st.sampled_from(LABELS) | st.text())
def test_expand_is_hkdf_expand(key: bytes, label: str) -> None:
    try:
        info = b"arena " + label.encode()
    except UnicodeEncodeError:
        return

    assert expand(key, label) == HKDFExpand(SHA256(), 32, info).derive(key)


@given(KEYS, KEYS)
def test_no_two_keys_are_alike(one: bytes, other: bytes) -> None:
    """Two match keys, five labels: ten keys that share no word but by chance, which 2**-32 does not have."""
    words = [word for key in {one, other} for label in LABELS for word in np.frombuffer(expand(key, label), "<u4")]

    assert len(set(words)) == len(words)


def test_every_team_and_purpose_has_a_key_of_its_own() -> None:
    keys = [
        tuple(pair) for part in philox_keys([MatchKeys(map_key=bytes(32), match_key=bytes(32))]) for pair in part.reshape(-1, 2)
    ]

    assert len(set(keys)) == len(keys) == 7


def test_keys_are_read_alike_on_every_machine() -> None:
    key, map_key = bytes(range(32)), bytes(range(32, 64))
    drawn = philox_keys([MatchKeys(map_key=bytes(32), match_key=bytes(32)), MatchKeys(map_key=map_key, match_key=key)])

    assert drawn.unit[1].tobytes().hex() == expand(key, "moves")[:16].hex() + expand(key, "fights")[:16].hex()
    assert drawn.unit[1, 0, 1, 0] == int.from_bytes(expand(key, "moves")[8:12], "little")
    assert drawn.unit[1, 1, 0, 1] == int.from_bytes(expand(key, "fights")[4:8], "little")
    assert drawn.seat[1, 1, 0] == int.from_bytes(expand(key, "red seed")[:4], "little")
    assert drawn.board[1, 1] == int.from_bytes(expand(map_key, "board")[4:8], "little")


def test_known_keys_stay_what_they_are() -> None:
    """A changed key is a changed match: raise `RULES_VERSION` and pin the new one."""
    secret = secret_from_seed(7)

    assert derive_map_key(secret, "a-b", 3).hex() == MAP_KEY
    assert derive_match_key(secret, "a-b-3-0").hex() == MATCH_KEY


MAP_KEY = "608603ba27fd61b8c3aae183dae7c331fbc967d92a68cdf3b6a72dea88ae03e4"
MATCH_KEY = "062b485cda752bac4cb700b825559882427c88ea6f4ebd53f2f21a07e2ae550d"


@pytest.mark.parametrize("derive", [lambda secret, name: derive_map_key(secret, name, 0), derive_match_key])
def test_another_secret_or_name_is_another_key(derive: Callable[[bytes, str], bytes]) -> None:
    keys = {derive(secret_from_seed(seed), name) for seed in range(3) for name in ("", "a", "b", "ab", "a\0b")}

    assert len(keys) == 15


def test_parts_of_a_name_do_not_run_together() -> None:
    secret = bytes(32)

    assert derive_map_key(secret, "a1", 2) != derive_map_key(secret, "a", 12)
    assert derive_map_key(secret, "a", 1) != derive_match_key(secret, "a1")
    assert derive_match_key(secret, "map") != derive_map_key(secret, "", 0)


def test_a_secret_is_new_each_time_and_a_seed_is_not() -> None:
    assert len({new_secret() for _ in range(100)}) == 100
    assert len(new_secret()) == len(secret_from_seed(1)) == 32
    assert secret_from_seed(1) == secret_from_seed(1) != secret_from_seed(2)


def test_legs_share_the_map_and_nothing_else() -> None:
    secret = secret_from_seed(1)
    map_key = derive_map_key(secret, "a-b", 0)
    legs = [MatchKeys(map_key=map_key, match_key=derive_match_key(secret, f"a-b-0-{leg}")) for leg in range(2)]
    games = BatchedGame(load("paper"), 2)

    games.start([0, 1], legs)

    state = games.state
    assert (state.ground[0] == state.ground[1]).all()
    assert (state.cell[0] == state.cell[1]).all()
    assert (state.field[0] == state.field[1]).all()
    assert not np.intersect1d(state.key[0], state.key[1]).size
    seeds = {int(seed) for seen in games.observe().values() for seed in seen.seed}
    assert len(seeds) == 4


def test_the_keys_of_a_match_do_not_touch_its_map_nor_those_of_a_map_its_match() -> None:
    games = BatchedGame(load("paper"), 3)
    keys = [MatchKeys(map_key=bytes([m] * 32), match_key=bytes([k] * 32)) for m, k in ((0, 0), (1, 0), (0, 1))]

    games.start([0, 1, 2], keys)

    state = games.state
    assert (state.key[0] == state.key[1]).all()
    assert (state.ground[0] != state.ground[1]).any()
    assert (state.ground[0] == state.ground[2]).all()
    assert (state.key[0] != state.key[2]).all()


def test_a_seat_gets_a_fresh_seed_at_each_tick_that_no_other_seat_gets() -> None:
    games = BatchedGame(load("paper"), 4)
    games.start(range(4), [MatchKeys(map_key=bytes(32), match_key=bytes([k] * 32)) for k in range(4)])
    seeds = []
    for tick in range(50):
        games.state.field[:, StateField.TICK] = tick
        seeds += [int(seed) for team in Team for seed in games.observe()[team].seed]

    assert len(set(seeds)) == 50 * 8
    assert max(seeds) >= 2**63
