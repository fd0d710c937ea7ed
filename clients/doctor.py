"""Checks for `arena doctor`: whether this machine is fit to play, and whether a pit answers."""

import platform
import time
from importlib.metadata import version
from pathlib import Path

from arena.errors import ArenaError
from arena.network.address import parse_address
from arena.network.session import open_client
from arena.protocol.identity import to_text
from clients.lobby import ask_challenge, ask_lobby

Finding = tuple[str, bool, str]
"""What was checked, whether it is well, and what was found."""


def examine(pit: str, authority: Path | None) -> list[Finding]:
    """Return the findings; that of the pit last, if one is named."""
    findings = [_check_versions(), _check_kernels()]
    if pit:
        findings.append(_check_pit(pit, authority))
    return findings


def _check_versions() -> Finding:
    packages = ", ".join(f"{name} {version(name)}" for name in ("arena-pit", "eclipse-zenoh", "numba", "numpy"))
    return "versions", True, f"Python {platform.python_version()} on {platform.machine()}; {packages}"


def _check_kernels() -> Finding:
    """Load, or compile, what every match needs."""
    begin_s = time.monotonic()
    from clients.precompile import precompile
    from policies.registry import load

    precompile(load("rush"))
    return "kernels", True, f"ready after {time.monotonic() - begin_s:.1f} s"


def _check_pit(pit: str, authority: Path | None) -> Finding:
    try:
        address = parse_address(pit)
        with open_client(address.endpoint, authority) as session:
            pit_key = ask_challenge(session, address).pit_key
            if address.fingerprint and to_text(pit_key) != address.fingerprint:
                return f"pit {address}", False, f"another pit stands there: its key is {to_text(pit_key)}"
            lobby = ask_lobby(session, address, pit_key)
    except ArenaError as error:
        return f"pit {pit}", False, str(error)
    leader = f", {lobby.standings[0].get('name')} leads its ladder" if lobby.standings else ""
    return (
        f"pit {address}",
        True,
        f"rules {lobby.rules}, {len(lobby.running)} matches running, {len(lobby.waiting)} waiting{leader}",
    )
