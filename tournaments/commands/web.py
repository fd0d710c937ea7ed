"""The sub-command of the web page: `arena web`."""

from pathlib import Path
from typing import Annotated

import typer

from arena.console import say

_GOODBYE_S = 2
"""How long open pages are waited for when the server ends."""


def web(
    pit: Annotated[
        str, typer.Option(metavar="ADDRESS", help="As `arena serve` prints it; the pit on this machine without it.")
    ] = "tcp/127.0.0.1:7447",
    port: Annotated[int, typer.Option(min=0, max=65535, help="Of the page; 0 takes a free one.")] = 8000,
    host: Annotated[str, typer.Option(help="Where to listen; the default lets in nobody but this machine.")] = "127.0.0.1",
    name: Annotated[
        list[str] | None, typer.Option(metavar="HOST", help="A name by which browsers reach the page, beside --host.")
    ] = None,
    spectator_key: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Of the pit's operator: prints a link that shows running matches.")
    ] = None,
    data: Annotated[Path | None, typer.Option(metavar="DIR", help="Where leagues live; your data folder without it.")] = None,
    db: Annotated[str, typer.Option(metavar="URL|FILE", help="The store of results; arena.db in --data without it.")] = "",
    authority: Annotated[
        Path | None, typer.Option(metavar="FILE", help="For arena+tls://...: who vouches for the pit's certificate (PEM).")
    ] = None,
    play: Annotated[
        bool | None, typer.Option(help="Whether people may play by the page, under keys of yours; on loopback they may.")
    ] = None,
    ends_with_stdin: Annotated[bool, typer.Option("--ends-with-stdin", hidden=True)] = False,
) -> None:
    """Show a pit, its matches and your leagues in the browser, and play there."""
    import sys
    import threading

    from arena.compiling import compile_kernels, game_kernels
    from arena.extras import needs
    from arena.folders import data_folder
    from arena.game.ruleset import load
    from arena.keyring.files import load_or_make, load_secret
    from arena.keyring.ring import entry_key_path
    from arena.metrics import exposition
    from arena.network.address import parse_address
    from arena.protocol.identity import to_text
    from arena.protocol.topics import check_chunk
    from clients.commands.connecting import trust
    from clients.human.turn_mailbox import TurnMailbox
    from clients.settings import ClientSettings
    from clients.web.guard import EVERYWHERE, LOOPBACK, list_names
    from clients.web.pit import PitClient
    from clients.web.play import BrowserSeats
    from tournaments.reports.web_leagues import Leagues
    from tournaments.reports.web_seasons import Seasons

    with needs("web", "arena web"):
        import uvicorn
        from uvicorn.protocols.websockets.websockets_sansio_impl import WebSocketsSansIOProtocol

        from clients.web.connections import MOST_CONNECTIONS, MOST_MESSAGE_BYTES, ImpatientProtocol
        from clients.web.server import WebSettings, listen, make_app

    exposition.check("arena web")
    names = list_names(host, name or ())
    address = parse_address(pit)
    fragment = "" if spectator_key is None else f"#key={to_text(load_secret(spectator_key))}"
    folder = data_folder(data)
    client = PitClient(address, authority, lambda pit_key: trust(address, pit_key))

    def make_settings(name: str, team: str, invite: str) -> ClientSettings:
        return ClientSettings(
            endpoint=address.endpoint,
            pit=address.pit,
            name=check_chunk("the name", name),
            team=team,
            make=TurnMailbox().make,
            n_matches=1,
            identity=load_or_make(entry_key_path(name)),
            invite=invite,
            trust=client.trust,
            authority=authority,
            transcripts=data_folder(folder / "transcripts"),
        )

    settings = WebSettings(
        pit=client,
        leagues=Leagues(folder, db),
        seasons=Seasons(folder, db),
        players=BrowserSeats(make_settings) if play or (play is None and host in LOOPBACK) else None,
        names=names,
    )
    listening = listen(host, port)
    shown = (name or names)[0] if host in EVERYWHERE else f"[{host}]" if ":" in host else host
    with listening:
        compile_kernels(game_kernels(load("paper")))  # they are the same for all rulesets
        say(f"web page at http://{shown}:{listening.getsockname()[1]}/{fragment}")
        config = uvicorn.Config(
            make_app(settings),
            log_level="warning",
            http=ImpatientProtocol,
            ws=WebSocketsSansIOProtocol,
            ws_max_size=MOST_MESSAGE_BYTES,
            limit_concurrency=MOST_CONNECTIONS,
            timeout_graceful_shutdown=_GOODBYE_S,
        )
        server = uvicorn.Server(config)
        if ends_with_stdin:

            def wait_for_end() -> None:
                sys.stdin.buffer.read()
                server.should_exit = True

            threading.Thread(target=wait_for_end, daemon=True).start()
        server.run(sockets=[listening])
