"""Key files: made whole or not at all, for their owner alone, and never written over.

An identity is an Ed25519 key, as PKCS8 in PEM without a password; a secret is 32 bytes, as a line of 43 letters, digits, - and _.
"""

import os
import secrets
import stat
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from errno import ENOTDIR
from pathlib import Path

from cryptography.exceptions import UnsupportedAlgorithm
from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey
from cryptography.hazmat.primitives.serialization import Encoding, NoEncryption, PrivateFormat, load_pem_private_key

from arena.errors import InputError, KeyFileError
from arena.protocol.identity import Identity, from_text, to_text

SECRET_BYTES = 32
_MOST_BYTES = 64 * 1024
_OWNER_ONLY, _OTHERS = 0o600, 0o077


def load_or_make(path: Path) -> Identity:
    """Return the key of a file, which is made if it is not there; processes that start at once get one and the same."""
    if not os.path.lexists(path):
        identity = Identity.make()
        if _place(path, _to_pem(identity)):
            return identity
    return load(path)


def make(path: Path) -> Identity:
    """Make a key where none is."""
    identity = Identity.make()
    if not _place(path, _to_pem(identity)):
        raise KeyFileError(f"{path} is there already and stays as it is; to make another key, name another file")
    return identity


def load(path: Path) -> Identity:
    """Read a key."""
    data = _read(path)
    try:
        private = load_pem_private_key(data, password=None)
    except TypeError as error:
        raise KeyFileError(f"{path} is locked by a password, which nobody here can type; name a key without one") from error
    except (ValueError, UnsupportedAlgorithm) as error:
        raise KeyFileError(f"{path} holds no private key, or not all of one; name another file, or restore this one") from error
    if not isinstance(private, Ed25519PrivateKey):
        raise KeyFileError(f"{path} holds a key of another kind; name one that is Ed25519")
    return Identity(private)


def load_or_make_secret(path: Path) -> bytes:
    """Return the secret of a file, as `load_or_make` does."""
    if not os.path.lexists(path):
        secret = secrets.token_bytes(SECRET_BYTES)
        if _place(path, f"{to_text(secret)}\n".encode()):
            return secret
    return load_secret(path)


def load_secret(path: Path) -> bytes:
    """Read a secret."""
    data = _read(path)
    try:
        return from_text(data.decode("ascii").strip())  # 32 bytes are written like a public key
    except (InputError, UnicodeDecodeError):
        sentence = f"{path} holds no secret of 43 letters, digits, - and _; name another file, or restore this one"
        raise KeyFileError(sentence) from None  # the cause would tell what the file holds


@contextmanager
def draft(path: Path, data: bytes) -> Iterator[Path]:
    """Write `data` whole beside `path`, for its owner alone, and lend the file's name until it has been put in its place."""
    make_folder(path.parent)
    descriptor, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.", suffix=".draft")
    try:
        with os.fdopen(descriptor, "wb") as file:
            os.fchmod(file.fileno(), _OWNER_ONLY)  # a umask can take away what mkstemp asks for
            file.write(data)
            file.flush()
            os.fsync(file.fileno())  # a name that outlives a power cut must not be empty
        yield Path(name)
    finally:
        Path(name).unlink(missing_ok=True)


def make_folder(folder: Path) -> None:
    """Make a folder and its parents for their owner alone, whatever the umask; those that are there stay as they are."""
    if folder.is_dir():
        return
    make_folder(folder.parent)
    try:
        folder.mkdir(0o700)
    except FileExistsError as error:
        if not folder.is_dir():
            raise NotADirectoryError(ENOTDIR, f"{folder} is no folder") from error
    else:
        folder.chmod(0o700)


def _place(path: Path, data: bytes) -> bool:
    """Put a new file there; False if there is one. A hard link, unlike a rename, never takes another's place."""
    try:
        with draft(path, data) as whole:
            path.hardlink_to(whole)
    except FileExistsError:
        return False
    except OSError as error:
        raise KeyFileError(f"cannot make the key file {path}: {error.strerror}; name another, or mend its folder") from error
    return True


def _read(path: Path) -> bytes:
    """Return what a key file holds, if nobody but its owner can read it."""
    try:
        descriptor = os.open(path, os.O_RDONLY | os.O_CLOEXEC | os.O_NONBLOCK)  # a pipe would never answer
        try:
            mode = os.fstat(descriptor).st_mode
            data = os.read(descriptor, _MOST_BYTES) if stat.S_ISREG(mode) else b""
        finally:
            os.close(descriptor)
    except FileNotFoundError as error:
        raise KeyFileError(f"there is no key file {path}; make one, or name one that is there") from error
    except PermissionError as error:
        raise KeyFileError(f"you may not read the key file {path}; ask its owner, or name one of your own") from error
    except OSError as error:
        raise KeyFileError(f"cannot read the key file {path}: {error.strerror}; name another, or restore this one") from error
    if not stat.S_ISREG(mode):
        raise KeyFileError(f"{path} is {'a folder' if stat.S_ISDIR(mode) else 'no file'}; name a key file")
    if mode & _OTHERS:
        raise KeyFileError(f"{path} can be read by others; chmod 600 it")
    return data


def _to_pem(identity: Identity) -> bytes:
    return identity.private.private_bytes(Encoding.PEM, PrivateFormat.PKCS8, NoEncryption())
