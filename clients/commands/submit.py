"""`arena submit`: enter a bot in a season, follow it, and go back to an earlier version."""

import sys
import time
from collections.abc import Mapping
from glob import escape, glob
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from arena.console import AsJson, print_json, print_table, progress_bar, say, say_lines
from arena.errors import InputError, UnreadableError
from arena.keyring.cli import complete_entry
from clients.commands.connecting import Authority, trust

if TYPE_CHECKING:
    from clients.submission import SeasonClient

_MODES = ("BOT", "--remote", "--status", "--log", "--roll-back", "--withdraw")


def complete_submission(incomplete: str) -> list[str]:
    """Return the files and folders that can be submitted and begin like `incomplete`, for the shell."""
    found = sorted(glob(f"{escape(incomplete)}*"))  # noqa: PTH207
    return [path for path in found if path.endswith((".py", ".safetensors", ".zip")) or Path(path).is_dir()]


def submit(
    bot: Annotated[
        str,
        typer.Argument(
            metavar="[BOT]",
            autocompletion=complete_submission,
            help="A bot file, a checkpoint, or a folder or .zip with bot.py, or with a file program that holds a command line.",
        ),
    ] = "",
    to: Annotated[str, typer.Option("--to", metavar="ADDRESS", help="As `arena season open` prints it.")] = "",
    name: Annotated[
        str, typer.Option(autocompletion=complete_entry, help="Of the entry; that of the file or folder without it.")
    ] = "",
    key: Annotated[Path | None, typer.Option(metavar="FILE", help="The entry's key; that of its name without it.")] = None,
    invite: Annotated[str, typer.Option(metavar="CODE", help="For a season that wants one.")] = "",
    remote: Annotated[bool, typer.Option("--remote", help="It plays from your machine: submit no code.")] = False,
    status: Annotated[
        bool, typer.Option("--status", help="Tell how the entry stands: its versions, checks and matches.")
    ] = False,
    log: Annotated[bool, typer.Option("--log", help="Show the end of what it printed in its matches.")] = False,
    roll_back: Annotated[int | None, typer.Option(min=1, metavar="N", help="Play version N again.")] = None,
    withdraw: Annotated[bool, typer.Option("--withdraw", help="Play no more; what was played stays.")] = False,
    authority: Authority = None,
    as_json: AsJson = False,
) -> None:
    """Submit a bot to a season, wait for its check, and tell what was found, as `arena check` does.

    What passes is a new version of the entry, and plays from then on. Hidden files and Python's caches stay behind. Exits with 1
    if the season refuses it. Only the holder of the entry's key is told how it stands.
    """
    from arena.files import MOST_BYTES
    from arena.keyring.files import load, load_or_make
    from arena.keyring.ring import entry_key_path
    from arena.network.address import parse_address
    from arena.network.session import open_client
    from arena.protocol.page_token import make_page_link
    from arena.protocol.topics import check_chunk
    from arena.submission import read_source
    from clients.submission import SeasonClient

    is_upload = bool(bot) and not (remote or status or log or withdraw or roll_back is not None)
    if is_upload + remote + status + log + withdraw + (roll_back is not None) != 1:
        raise InputError(f"name one thing to do: {', '.join(_MODES)}")
    if not to:
        raise InputError("say where the season is: --to ADDRESS, as `arena season open` prints it")
    where = parse_address(to)
    packed = read_source(Path(bot), MOST_BYTES).pack() if is_upload else b""
    entry = check_chunk("the name", name or _name_of(bot))
    path = entry_key_path(entry) if key is None else key
    identity = load_or_make(path) if key is None and (is_upload or remote) else load(path)
    with open_client(where.endpoint, authority) as session:
        season = SeasonClient(session, where, identity, entry, invite, trust=lambda pit_key: trust(where, pit_key))
        try:
            if is_upload:
                _upload(season, entry, packed, as_json=as_json)
            elif status:
                answer = season.ask("status")
                facts = answer.facts
                if facts.get("page"):
                    facts = {**facts, "page": make_page_link(identity, facts["page"], where.pit, entry, time.time())}
                _print_status(answer.text, facts, as_json=as_json)
            elif log:
                _print_log(season, as_json=as_json)
            else:
                command = "remote" if remote else "withdraw" if withdraw else "roll-back"
                answer = season.ask(command, number=roll_back or 0)
                if as_json:
                    print_json({"ok": True, "says": answer.text, **answer.facts})
                else:
                    say(answer.text, *([f"it joins with: {answer.facts['join']}"] if answer.facts.get("join") else []))
        except (KeyError, TypeError, ValueError, AttributeError) as error:
            raise UnreadableError(f"the season tells of {entry} in a way that this arena does not read ({error!r})") from error


def _name_of(bot: str) -> str:
    if not bot:
        raise InputError("say which entry is meant: --name NAME")
    path = Path(bot).absolute()
    return path.name if path.is_dir() else path.stem


def _upload(season: "SeasonClient", entry: str, packed: bytes, *, as_json: bool) -> None:
    """Submit, wait for the check, and tell what came of it; exits with 1 if it was refused."""
    with progress_bar(len(packed), f"submitting {entry}", each="bytes") as advance:
        answer = season.upload(packed, advance)
    say(f"{entry}: {answer.text}", err=True)
    try:
        found = season.wait_for_check(answer.facts["submission"])
    except KeyboardInterrupt as interrupt:
        interrupt.add_note(f"it is checked all the same; to see what comes of it: arena submit --status --name {entry} --to ...")
        raise
    is_accepted = found["state"] == "accepted"
    if as_json:
        print_json({"ok": is_accepted, "entry": entry, **{key: found[key] for key in ("number", "says", "report")}})
    else:
        say(*((found["report"] or {}).get("text") or ()))
        say(f"version {found['number']} of {entry} plays from now on" if is_accepted else f"refused: {found['says']}")
    if not is_accepted:
        sys.exit(1)


def _print_log(season: "SeasonClient", *, as_json: bool) -> None:
    text = b"".join(season.read_log()).decode("utf-8", "replace")
    if as_json:
        print_json({"log": text})
    elif text:
        say_lines(text)
    else:
        say("it has printed nothing yet", err=True)


def _print_status(says: str, facts: Mapping[str, Any], *, as_json: bool) -> None:
    if as_json:
        print_json(facts)
        return
    standing = facts.get("standing")
    say(says)
    n_matches = sum(standing[key] for key in ("wins", "draws", "losses")) if standing else 0
    if standing and not n_matches:
        say("it has played no match yet")
    elif standing:
        around = f"95% from {standing['elo_low']:.0f} to {standing['elo_high']:.0f}"
        record = f"{standing['wins']} won, {standing['draws']} drawn, {standing['losses']} lost"
        say(f"it is number {standing['rank']} with {standing['elo']:.0f} Elo ({around}): {record}")
    if facts.get("versions"):
        print_table(("version", "entered", "was rated"), [_version_row(one) for one in facts["versions"]])
    print_table(
        ("submitted", "bytes", "state", "version", "what was said"),
        [
            (_moment(one["received_at"]), one["n_bytes"], one["state"], one["number"] or "", one["says"])
            for one in facts["submissions"]
        ],
    )
    for match in facts.get("matches", ()):
        say(f"{match['label']} against {match['opponent']}: {match['how']}")
    for what, key in (("it joins with", "join"), ("its page", "page")):
        if facts.get(key):
            say(f"{what}: {facts[key]}")


def _version_row(version: Mapping[str, Any]) -> tuple[object, ...]:
    rating = version["rating"] or {}
    rated = f"{rating['elo']:.0f} ({rating['elo_low']:.0f} to {rating['elo_high']:.0f})" if "elo" in rating else ""
    return version["number"], _moment(version["entered_at"]), rated


def _moment(at_s: float) -> str:
    from datetime import datetime

    return datetime.fromtimestamp(at_s).astimezone().strftime("%Y-%m-%d %H:%M")
