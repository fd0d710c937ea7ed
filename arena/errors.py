"""The errors that the arena raises on purpose, and what each means to the command line.

ArenaError                  exit 1: the arena says no
├── InputError              exit 2: wrong usage or input
│   ├── UnknownNameError    a name that is not there; carries the nearest known one
│   ├── RulesetError        a ruleset that cannot be played
│   ├── BoardError          a board that cannot be played
│   ├── PolicyError         a bot file, or a policy, that cannot be loaded
│   ├── JournalError        a journal that cannot be read as one
│   └── KeyFileError        a key file that cannot be used, or a pit whose key is another than before
├── ProtocolError           the other side's fault: ruled on, recorded, played on
│   ├── UnreadableError     bytes that are no message
│   │   └── VersionError    a message of another version of the protocol
│   └── ForgedError         sealed or signed by another, changed, moved, or said before
├── RefusedError            the pit does not let this client play
└── LostPitError            the pit cannot be reached
"""

from collections.abc import Iterable
from difflib import get_close_matches


class ArenaError(Exception):
    """Base of every error that a user may see: one clear sentence, or one for each argument, to be printed a line each."""

    exit_code = 1

    def __str__(self) -> str:
        return "\n".join(map(str, self.args))


class InputError(ArenaError):
    """The caller named, wrote or passed something wrong; nothing was changed."""

    exit_code = 2


class UnknownNameError(InputError):
    """A name that is not among the known ones."""

    def __init__(self, kind: str, name: str, known: Iterable[str]) -> None:
        names = sorted(known)
        nearest = get_close_matches(name, names, n=1, cutoff=0.5)
        hint = f"did you mean {nearest[0]!r}?" if nearest else f"known: {', '.join(names)}"
        super().__init__(f"unknown {kind} {name!r}; {hint}")
        self.kind, self.name = kind, name


class RulesetError(InputError):
    """A ruleset holds a value that no game can be played with."""


class BoardError(InputError):
    """A board cannot be read, drawn or played on."""


class PolicyError(InputError):
    """A bot file or a policy cannot be loaded."""


class JournalError(InputError):
    """A journal is truncated, or was changed."""


class KeyFileError(InputError):
    """A key cannot be used, and nothing was written over it."""


class ProtocolError(ArenaError):
    """The other side said something that the protocol does not allow."""


class UnreadableError(ProtocolError):
    """Bytes that are no message of this version."""


class VersionError(UnreadableError):
    """A message of another version of the protocol."""


class ReplayedError(ProtocolError):
    """A genuine message comes again, or behind one that was sent after it."""


class ForgedError(ProtocolError):
    """A seal or a signature that does not hold."""


class RefusedError(ArenaError):
    """The pit does not let this client play; its own sentence says why."""


class LostPitError(ArenaError):
    """No pit answers."""
