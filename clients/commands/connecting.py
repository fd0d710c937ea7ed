"""What the commands that connect to a pit share: the option for its certificate, and trust at first use."""

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from arena.console import say

if TYPE_CHECKING:
    from arena.network.address import Address

Authority = Annotated[
    Path | None, typer.Option(metavar="FILE", help="For arena+tls://...: who vouches for the pit's certificate (PEM).")
]


def trust(where: "Address", pit_key: bytes, show: Callable[[str], None] | None = None) -> None:
    """Refuse a pit that is not the one of the address, or not the one that was there before; show, or print, that it is new."""
    from arena.keyring.known_pits import check_pit
    from arena.protocol.identity import from_text, to_text

    place = f"{where.endpoint.partition('/')[2]}/{where.pit}"
    if check_pit(place, pit_key, from_text(where.fingerprint) if where.fingerprint else None):
        note = f"this pit is new here; from now on {place} must show the key {to_text(pit_key)}"
        (partial(say, err=True) if show is None else show)(note)
