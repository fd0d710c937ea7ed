"""Whose signatures a journal must bear: by the keys that were named on the command line, and by those that this machine knows."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from arena.errors import InputError
from arena.game.types import Team
from arena.keyring.files import load
from arena.keyring.known_pits import known_pits
from arena.keyring.ring import KEY_SUFFIX, list_entries
from arena.network.address import parse_address
from arena.protocol.identity import from_text, to_text
from arena.records.journal import Header, Seals

PIT = "pit"
_JOURNALS, _KEYS, _ENTRIES = "journals", "keys", "entries"


@dataclass(frozen=True, slots=True, kw_only=True)
class Keyring:
    """The keys of some pit, and of entries by their names."""

    pit: bytes | None = None
    """None if any pit will do."""
    entries: Mapping[str, bytes] = field(default_factory=dict)


class Signers:
    """What is known of who may sign journals.

    Parameters
    ----------
    named
        What the user named, which comes before all that is known.
    data
        The data folder of this machine: the pits whose journals lie there have their keys beside them.
    """

    def __init__(self, named: Keyring, data: Path) -> None:
        self._named, self._data = named, data.absolute()
        self._own = {name: key.public for name, key in list_entries() if not isinstance(key, str)}
        self._labels = {key: f"your key {name}" for name, key in self._own.items()}
        self._labels |= {key: where for where, key in known_pits().items()}
        self._kept: dict[Path, Keyring] = {}

    def describe(self, key: bytes, path: Path) -> str | None:
        """Return where a key is known from; None if it is not."""
        kept = self._kept_beside(path)
        if key == self._named.pit:
            return "--pit"
        if key in self._named.entries.values():
            return "--entry"
        if key == kept.pit:
            return "the pit of this data folder"
        return next((f"the key {name} of this league" for name, one in kept.entries.items() if one == key), self._labels.get(key))

    def find_impostor(self, header: Header, seals: Seals, path: Path) -> str:
        """Return in a sentence who signed in another's name, or nothing.

        Parameters
        ----------
        path
            Of the journal, whose signatures were found to be those of the keys that it names.
        """
        kept = self._kept_beside(path)
        for wanted, source in ((self._named.pit, "--pit"), (kept.pit, "the key beside these journals")):
            if wanted is not None and seals.pit_key != wanted:
                return f"it is signed by the pit {to_text(seals.pit_key)}; {source} is {to_text(wanted)}"
            if wanted is not None:
                break
        for team, name in ((Team.BLUE, header.blue), (Team.RED, header.red)):
            key = seals.entries[team]
            for entries, source in ((self._named.entries, "--entry"), (kept.entries, "the key beside these journals")):
                if name in entries:
                    if key != entries[name]:
                        return f"its {name} has the key {to_text(key)}; {source} is {to_text(entries[name])}"
                    break
            else:
                if name in self._own and key != self._own[name]:
                    way_out = (
                        f"if another has that name there, say --entry {name}={to_text(key)}; for a league of yours, --data DIR"
                    )
                    return f"its {name} has the key {to_text(key)}, not your own key of that name; {way_out}"
        return ""

    def _kept_beside(self, path: Path) -> Keyring:
        """Return the keys of the pit that wrote a journal into this machine's data folder; none for a journal from elsewhere."""
        folder = path.absolute().parent
        if folder not in self._kept:
            is_own = folder == self._data / _JOURNALS or folder.parent == self._data / _JOURNALS
            keys = self._data / _KEYS / folder.relative_to(self._data / _JOURNALS) if is_own else None
            self._kept[folder] = Keyring() if keys is None else _load_folder(keys)
        return self._kept[folder]


def read_named(pit: str, entries: Iterable[str]) -> Keyring:
    """Read `--pit` and `--entry`; `InputError` if a key is none, or a name is given two."""
    keys: dict[str, bytes] = {}
    for text in entries:
        name, sign, key = text.partition("=")
        if not sign:
            raise InputError(f"--entry is {text!r}; write NAME=KEY")
        if keys.setdefault(name, from_text(key)) != from_text(key):
            raise InputError(f"--entry gives {name} two keys; keep one")
    return Keyring(pit=_read_pit(pit) if pit else None, entries=keys)


def _read_pit(text: str) -> bytes:
    if "://" not in text:
        return from_text(text)
    fingerprint = parse_address(text).fingerprint
    if not fingerprint:
        raise InputError(f"--pit is {text}, an address without a key; write it with the #KEY that arena serve prints")
    return from_text(fingerprint)


def _load_folder(folder: Path) -> Keyring:
    """Return the public keys of a folder of private ones, as a pit or a league keeps them."""
    entries = {path.stem: public for path in sorted((folder / _ENTRIES).glob(f"*{KEY_SUFFIX}")) if (public := _load(path))}
    return Keyring(pit=_load(folder / f"{PIT}{KEY_SUFFIX}"), entries=entries)


def _load(path: Path) -> bytes | None:
    """Return a public key; None if it cannot be read, and so is not known."""
    try:
        return load(path).public
    except InputError:
        return None
