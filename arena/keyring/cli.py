"""The sub-commands of the keys: `arena keys`."""

import re
from contextlib import suppress
from typing import TYPE_CHECKING, Annotated, Any

import typer

from arena.console import AsJson, print_json, print_table, say
from arena.errors import ArenaError, UnknownNameError

if TYPE_CHECKING:
    from arena.protocol.identity import Identity

_SCHEME = re.compile(r"arena(\+[a-z]+)?://")
"""Of an address, by whatever protocol: a pit is remembered by where it is."""
keys = typer.Typer(no_args_is_help=True, help="Make and show the keys of entries, and forget those of pits.")


def complete_entry(incomplete: str) -> list[str]:
    """Return the entries with a key that begin like `incomplete`, for the shell."""
    from arena.keyring.ring import entry_names

    with suppress(ArenaError):
        return [name for name in entry_names() if name.startswith(incomplete)]
    return []


def complete_pit(incomplete: str) -> list[str]:
    """Return the known pits that begin like `incomplete`, for the shell."""
    from arena.keyring.known_pits import known_pits

    with suppress(ArenaError):
        return [where for where in sorted(known_pits()) if where.startswith(incomplete)]
    return []


Name = Annotated[
    str, typer.Argument(metavar="[NAME]", autocompletion=complete_entry, help="The entry; every one that has a key without it.")
]


@keys.command("new")
def make_key(name: Annotated[str, typer.Argument(metavar="NAME", help="The entry's name.")]) -> None:
    """Make the key of an entry. Whoever has its file plays under that name; one that is there is left alone."""
    from arena.keyring.files import make
    from arena.keyring.ring import entry_key_path

    _print_facts(_facts(name, make(entry_key_path(name))))


@keys.command("show")
def show_keys(name: Name = "", as_json: AsJson = False) -> None:
    """Show an entry's public key, and where its private key is."""
    facts = [_load(name)] if name else _all_facts()
    if as_json:
        print_json(facts[0] if name else facts)
        return
    for index, one in enumerate(facts):
        if index:
            say("")
        _print_facts(one)


@keys.command("list")
def list_keys(as_json: AsJson = False) -> None:
    """List the entries that have a key here, and what is wrong with a key that cannot be used."""
    facts = _all_facts()
    if as_json:
        print_json(facts)
    else:
        rows = [(one["name"], one["public_key"] or "", one["wrong"] or one["file"]) for one in facts]
        print_table(("name", "public key", "file, or what is wrong"), rows)


@keys.command("forget")
def forget_pit(
    pit: Annotated[str, typer.Argument(metavar="HOST:PORT/PIT", autocompletion=complete_pit, help="The pit, or its address.")],
) -> None:
    """Forget a pit's key, and trust the one that it has next."""
    from arena.keyring.known_pits import forget

    where = _SCHEME.sub("", pit, count=1).partition("#")[0]
    forget(where)
    say(f"forgot the pit at {where}; the key that it has next time is trusted")


def _load(name: str) -> dict[str, Any]:
    from arena.keyring.files import load
    from arena.keyring.ring import entry_key_path, entry_names

    path, names = entry_key_path(name), entry_names()
    if names and name not in names:
        raise UnknownNameError("entry", name, names)
    return _facts(name, load(path))


def _all_facts() -> list[dict[str, Any]]:
    from arena.keyring.ring import list_entries

    entries = list_entries()
    if not entries:
        say("no entry has a key yet; to make one: arena keys new NAME", err=True)
    return [_facts(name, key) for name, key in entries]


def _facts(name: str, key: "Identity | str") -> dict[str, Any]:
    from arena.keyring.ring import KEY_SUFFIX, keys_folder

    wrong = key if isinstance(key, str) else None
    public_key = None if isinstance(key, str) else key.fingerprint
    return {"name": name, "public_key": public_key, "file": str(keys_folder() / (name + KEY_SUFFIX)), "wrong": wrong}


def _print_facts(facts: dict[str, Any]) -> None:
    for what, value in facts.items():
        if value is not None:
            say(f"{what.replace('_', ' ')}: {value}")
