"""The secret of a league, from which every map and every fight follows: 32 bytes that nobody sees before the last match."""

import os
from hashlib import sha256
from pathlib import Path

from arena.errors import InputError
from arena.game.keys import KEY_BYTES, new_secret, secret_from_seed
from tournaments.league.league import League


def find_secret(league: League, folder: Path, *, may_make: bool) -> bytes:
    """Return a league's secret: its seed's, its file's own, or the one that is kept in `folder`, made at the first run.

    Raises
    ------
    InputError
        The secret is gone, though results follow from it (`may_make` is off), or cannot be kept.
    """
    if league.seed is not None:
        return secret_from_seed(league.seed)
    if league.secret is not None:
        return league.secret
    path = folder / f"{league.name}.secret"
    try:
        if path.exists():
            return _parse(path)
        if not may_make:
            raise InputError(f"league {league.name} has results, and the secret that they follow from is not in {path}")
        return _make(path)
    except OSError as error:
        raise InputError(f"cannot keep the league's secret in {path}: {error.strerror}") from error


def recall_secret(league: League, folder: Path, commitment: str) -> bytes | None:
    """Return the secret that a league was played under, by what binds it to that; None if it cannot be had."""
    try:
        secret = find_secret(league, folder, may_make=False)
    except InputError:
        return None
    return secret if commit_to(secret) == commitment else None


def commit_to(secret: bytes) -> str:
    """Return what binds a league to its secret and does not tell it: SHA-256 (hex) under a label."""
    return sha256(b"arena league secret " + secret).hexdigest()


def _parse(path: Path) -> bytes:
    try:
        secret = bytes.fromhex(path.read_text(encoding="ascii"))
    except ValueError:
        secret = b""
    if len(secret) != KEY_BYTES:
        raise InputError(f"{path} holds no secret of {2 * KEY_BYTES} hexadecimal digits")
    return secret


def _make(path: Path) -> bytes:
    path.parent.mkdir(parents=True, exist_ok=True)
    secret = new_secret()
    draft = path.with_suffix(".draft")
    draft.unlink(missing_ok=True)
    descriptor = os.open(draft, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
    with os.fdopen(descriptor, "w", encoding="ascii") as file:
        file.write(secret.hex() + "\n")
    draft.rename(path)  # at once whole: a secret that was cut short would lose the league
    return secret
