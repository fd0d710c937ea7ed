"""Which name is whose, which invite code was used by whom, and who may not come back: in a file that the operator can read.

The file is one JSON object, written whole when the pit opens, and behind it the changes since, a line each: a name more costs the
same however many there are. A last line that was cut off by a crash counts for nothing.
"""

import json
import os
import tempfile
from collections.abc import Iterable, Mapping
from pathlib import Path

from arena.errors import ArenaError, InputError
from arena.protocol.identity import from_text, is_public_key, to_text
from arena.protocol.messages import JoinRequest, SeasonRequest

_PARTS = ("names", "invites", "banned")
_Parts = tuple[dict[str, str], dict[str, str], dict[str, str]]


class Register:
    """Names, invites and bans; kept in `path`, or in memory alone."""

    def __init__(self, path: Path | None = None, invites: Iterable[str] | None = None, names: Mapping[str, bytes] | None = None):
        """Open a register; `invites` are codes, or, as `read_invites` has them, codes and whose each is."""
        self._path = path
        self._codes = None if invites is None else frozenset(invites)
        self._owners = invites if isinstance(invites, Mapping) else {}
        self._names = {name: to_text(key) for name, key in (names or {}).items()}
        self._invites: dict[str, str] = {}
        self._banned: dict[str, str] = {}
        """By public key: the name under which it was banned."""
        self._changes: list[tuple[str, str, str | None]] = []
        """Since it was saved last: the part, the key there, and its value; None where it is gone."""
        self._is_on_disk = path is not None and path.exists()
        if path is not None and self._is_on_disk:
            self._load(path)

    @property
    def is_changed(self) -> bool:
        """Whether anything changed since it was saved last."""
        return bool(self._changes)

    @property
    def needs_invite(self) -> bool:
        """Whether only those with a code may play."""
        return self._codes is not None

    def has_invited(self, entry: bytes) -> bool:
        """Whether a key has used an invite code."""
        return to_text(entry) in self._invites.values()

    def object_to(self, request: JoinRequest | SeasonRequest) -> str:
        """Return why an entry may not play, or nothing."""
        entry = to_text(request.entry)
        if entry in self._banned:
            return "this key is banned from the pit"
        if is_public_key(request.name):  # it would mislead an operator who bans a key
            return "a name must not look like a public key; choose another with --name"
        owner = self._names.get(request.name, entry)
        if owner != entry:
            return (
                f"the name {request.name} belongs to another key; choose one with --name, or ask the operator for "
                f"`arena admin release-name {request.name}`"
            )
        if self._codes is not None:
            if not request.invite:
                return "this pit wants an invite code; join with --invite CODE"
            if request.invite not in self._codes:
                return "the invite code is none of this pit's"
            if self._invites.get(request.invite, entry) != entry:
                return "the invite code was used by another key"
        return ""

    def admit(self, request: JoinRequest | SeasonRequest) -> None:
        """Tie the invite code to the entry that came with it."""
        if self._codes is not None and request.invite not in self._invites:
            self._invites[request.invite] = to_text(request.entry)
            self._changes.append(("invites", request.invite, self._invites[request.invite]))

    def owner_of(self, entry: bytes) -> str:
        """Return what tells whose an entry is: the same for keys whose invite codes have one owner, else the key itself."""
        key = to_text(entry)
        return next(
            (f"owner {self._owners[code]}" for code, its in list(self._invites.items()) if its == key and code in self._owners),
            key,
        )

    def claim(self, name: str, entry: bytes) -> None:
        """Give a name to the key that finished a match under it, if it is nobody's yet."""
        if name not in self._names:
            self._names[name] = to_text(entry)
            self._changes.append(("names", name, self._names[name]))

    def release(self, name: str) -> bool:
        """Take a name from its key; False if it was nobody's."""
        if self._names.pop(name, None) is None:
            return False
        self._changes.append(("names", name, None))
        return True

    def ban(self, name: str, entry: bytes) -> None:
        """Let a key play no more."""
        self._banned[to_text(entry)] = name
        self._changes.append(("banned", to_text(entry), name))

    def find(self, target: str) -> bytes | None:
        """Return the key that a name belongs to, or that the text itself is."""
        if target in self._names:
            return from_text(self._names[target])
        try:
            return from_text(target)
        except InputError:
            return None

    def save(self) -> None:
        """Write what changed, or nothing; `ArenaError` if it cannot be written."""
        if self._path is not None:
            if self._is_on_disk:
                self._append(self._path)
            else:
                self._write(self._path)
                self._is_on_disk = True
        self._changes.clear()

    def _append(self, path: Path) -> None:
        """Write the changes, or nothing: behind a line that was cut off, the next change would make the file unreadable."""
        data = "".join(f"\n{json.dumps(change)}" for change in self._changes).encode()
        try:
            with path.open("ab", buffering=0) as file:
                n_before = file.tell()
                n_written = file.write(data)
                if n_written != len(data):
                    file.truncate(n_before)
        except OSError as error:
            raise ArenaError(f"cannot write {path}: {error.strerror}") from error
        if n_written != len(data):
            raise ArenaError(f"cannot write {path}: the disk is full")

    def _write(self, path: Path) -> None:
        """Write all, or nothing."""
        values = dict(zip(_PARTS, (self._names, self._invites, self._banned), strict=True))
        new = None
        try:
            descriptor, name = tempfile.mkstemp(dir=path.parent)  # of mode 0600
            new = Path(name)
            with os.fdopen(descriptor, "w") as file:
                json.dump(values, file, indent=1)
            new.replace(path)
        except OSError as error:
            if new is not None:
                new.unlink(missing_ok=True)
            raise ArenaError(f"cannot write {path}: {error.strerror}") from error

    def _load(self, path: Path) -> None:
        try:
            text = path.read_text()
            (names, invites, banned), n_changes = _read(text)
            for key in (*names.values(), *invites.values(), *banned):
                from_text(key)
        except OSError as error:
            raise InputError(f"cannot read {path}: {error.strerror}") from error
        except (InputError, ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
            raise InputError(f"{path} is no register of names; move it away to begin a new one") from error
        self._names, self._invites, self._banned = names, invites, banned
        if n_changes:
            self._write(path)


def _read(text: str) -> tuple[_Parts, int]:
    """Return what a register holds, and how many changes stand behind its object."""
    text = text.lstrip()
    values, end = json.JSONDecoder().raw_decode(text)
    names, invites, banned = ({str(k): str(v) for k, v in values[part].items()} for part in _PARTS)
    by_name = dict(zip(_PARTS, (names, invites, banned), strict=True))
    rest, *lines = text[end:].split("\n")
    if rest.strip():
        raise ValueError("something else stands behind the object")
    for number, line in enumerate(lines, start=1):
        if not line.strip():
            continue
        try:
            change = json.loads(line)
        except ValueError:
            if number < len(lines):
                raise
            break  # it was cut off when its writer died
        part, key, value = change
        if value is None:
            by_name[part].pop(str(key), None)
        else:
            by_name[part][str(key)] = str(value)
    return (names, invites, banned), len(lines)


def read_invites(path: Path) -> dict[str, str]:
    """Return the codes of a file, one a line, and whose each is; what follows # is a comment.

    Behind a code may stand its owner, one word; else it is an owner of its own.
    """
    try:
        lines = [line.partition("#")[0].split() for line in path.read_text().splitlines()]
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"cannot read invites from {path}: {getattr(error, 'strerror', None) or 'it is no text'}") from error
    lines = [words for words in lines if words]
    if not lines:
        raise InputError(f"{path} holds no invite codes; write one a line")
    if any(len(words) > 2 for words in lines):
        raise InputError(
            f"{path} holds a line of more than two words; write an invite code, and behind it its owner, if you like"
        )
    owners = {words[0]: words[-1] for words in lines}
    if len(owners) < len(lines):
        raise InputError(f"{path} holds an invite code twice")
    return owners
