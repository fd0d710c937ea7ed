"""What `arena doctor` looks at: whether this machine is fit to play, and whether a pit answers."""

import platform
import queue
import time
from importlib.metadata import version

from arena.address import Address, parse_address
from arena.errors import ArenaError, UnreadableError
from arena.protocol import topics
from arena.protocol.codec import decode
from arena.protocol.facts import read_fact
from arena.protocol.identity import from_text
from arena.protocol.messages import Lobby, Signed
from arena.transport import open_client

_ANSWER_S = 3.0
Finding = tuple[str, bool, str]
"""What was looked at, whether it is well, and what was found."""


def examine(pit: str) -> list[Finding]:
    """Return the findings; the pit's last, if one is named."""
    findings = [_look_at_versions(), _look_at_kernels()]
    if pit:
        findings.append(_look_at_pit(pit))
    return findings


def _look_at_versions() -> Finding:
    packages = ", ".join(f"{name} {version(name)}" for name in ("arena-pit", "eclipse-zenoh", "numba", "numpy"))
    return "versions", True, f"Python {platform.python_version()} on {platform.machine()}; {packages}"


def _look_at_kernels() -> Finding:
    """Load, or compile, what every match needs."""
    begin_s = time.monotonic()
    from clients.warm import warm
    from policies.registry import load

    warm(load("rush"))
    return "kernels", True, f"ready after {time.monotonic() - begin_s:.1f} s"


def _look_at_pit(pit: str) -> Finding:
    try:
        address = parse_address(pit)
        lobby = ask_lobby(address)
    except ArenaError as error:
        return f"pit {pit}", False, str(error)
    if lobby is None:
        return f"pit {address}", False, f"a router answers there, and no pit called {address.pit}"
    return f"pit {address}", True, f"rules {lobby.rules}, {len(lobby.running)} matches running, {len(lobby.waiting)} waiting"


def ask_lobby(address: Address) -> Lobby | None:
    """Return the public facts of a pit, or None if none answers on that router.

    Raises
    ------
    ProtocolError
        The pit speaks another version, or is not the one whose key the address names.
    """
    answers: queue.SimpleQueue[bytes] = queue.SimpleQueue()
    with open_client(address.endpoint) as session:
        session.ask(topics.lobby(address.pit), b"", answers.put, _ANSWER_S)
        try:
            answer = answers.get(timeout=_ANSWER_S)
        except queue.Empty:
            return None
    if not answer:
        return None
    message = decode(answer)
    if not isinstance(message, Signed):
        raise UnreadableError("the pit's lobby is not signed")
    fact = read_fact(message, from_text(address.fingerprint)) if address.fingerprint else decode(message.data)
    return fact if isinstance(fact, Lobby) else None
