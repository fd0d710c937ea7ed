"""`arena relay`: spectators of a pit, so many that they would cost its matches time, at an address of their own."""

from pathlib import Path
from typing import Annotated

import typer

from arena.console import say
from clients.commands.connecting import Authority, trust


def relay(
    pit: Annotated[str, typer.Argument(metavar="ADDRESS", help="Of the pit.")],
    listen: Annotated[str, typer.Option(metavar="ENDPOINT", help="Where spectators come.")] = "tcp/127.0.0.1:7449",
    certificate: Annotated[
        tuple[Path, Path] | None, typer.Option(metavar="CERT KEY", help="For --listen tls/HOST:PORT: two PEM files.")
    ] = None,
    authority: Authority = None,
) -> None:
    """Let any number of spectators watch a pit; to the pit, they are one.

    It hears the pit once, and answers what spectators ask from what it asked last. Nobody can play through it.
    """
    import signal
    from dataclasses import replace

    from arena.network.access import Certificate
    from arena.network.address import parse_address
    from arena.network.session import open_router
    from arena.protocol.identity import to_text
    from clients.relay import Relay

    address = parse_address(pit)
    presented = None if certificate is None else Certificate(certificate=certificate[0], key=certificate[1])
    with open_router(listen, address.pit, presented, for_players=False) as router:

        def check(pit_key: bytes) -> None:
            trust(address, pit_key)
            here = replace(address, endpoint=listen, fingerprint=to_text(pit_key))
            say(f"relay open at {here}", f"watch with: arena watch --pit {here}")

        relayed = Relay(address, authority, router, check, lambda words: say(words, err=True))
        for number in (signal.SIGTERM, signal.SIGINT):
            signal.signal(number, lambda *_: relayed.stop())
        relayed.run()
