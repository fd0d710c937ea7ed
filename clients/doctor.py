"""Checks for `arena doctor`: whether this machine is fit to play, and whether a pit answers."""

import platform
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path

from arena.compiling import Kernel, compile_kernels, find_missing, game_kernels
from arena.errors import ArenaError
from arena.game.ruleset import load
from arena.jit import cache_root
from arena.network.address import parse_address
from arena.network.session import open_client
from arena.protocol.codec import MOST_LISTED
from arena.protocol.identity import to_text
from arena.sandbox.bubblewrap import why_no_limits, why_no_wall
from clients.lobby import ask_challenge, ask_lobby
from policies.precompile import fighter_kernels
from policies.registry import OWN, shipped

Finding = tuple[str, bool, str]
"""What was checked, whether it is well, and what was found."""


def compile_all() -> None:
    """Compile the rules and all fighters that can play here, and say on stderr how far that is; nothing, if they are compiled."""
    compile_kernels(_all_kernels())


def examine(pit: str, authority: Path | None) -> list[Finding]:
    """Return the findings; that of the pit last, if one is named."""
    findings = [_check_versions(), _check_kernels(), _check_sandbox()]
    if pit:
        findings.append(_check_pit(pit, authority))
    return findings


def _check_versions() -> Finding:
    packages = ", ".join(f"{name} {version(name)}" for name in ("arena-pit", "eclipse-zenoh", "numba", "numpy"))
    return "versions", True, f"Python {platform.python_version()} on {platform.machine()}; {packages}"


def _check_kernels() -> Finding:
    """Load what matches need; what is missing is no fault, for the first command that needs it compiles it."""
    kernels, root = _all_kernels(), cache_root()
    missing = find_missing(kernels)
    if not missing:
        return "kernels", True, f"compiled: all {len(kernels)}, in {root}"
    names = ", ".join(kernel.name for kernel in missing)
    return (
        "kernels",
        True,
        f"{len(missing)} of {len(kernels)} are not compiled yet ({names}), in {root}; arena doctor --compile does it now",
    )


def _check_sandbox() -> Finding:
    why = why_no_wall() or why_no_limits()
    return "sandbox", why is None, why or "strangers' fighters can be kept behind walls, under limits"


def _all_kernels() -> list[Kernel]:
    """Return the kernels of the game, each fighter and the environments; of networks, if what computes them is installed."""
    networks = shipped() if find_spec("torch") else ()
    environments = Kernel(name="environments", run=_prepare_environments, seconds=2)
    return [*game_kernels(load("paper")), *fighter_kernels((*OWN, *networks)), environments]


def _prepare_environments() -> None:
    """Compile, or load, what turns a bot's observation into an environment's."""
    from arena.envs.views import prepare  # compiles as it is imported

    prepare()


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
    n_running, n_waiting = (f"{len(some)}{' or more' * (len(some) == MOST_LISTED)}" for some in (lobby.running, lobby.waiting))
    leader = f", {lobby.standings[0].get('name')} leads its ladder" if lobby.standings else ""
    return (
        f"pit {address}",
        True,
        f"rules {lobby.rules}, {n_running} matches running, {n_waiting} waiting{leader}",
    )
