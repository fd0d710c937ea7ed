"""The sub-commands of journals and transcripts: `arena replay`."""

from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from arena.console import AsJson, print_json, print_table, say
from arena.errors import InputError

if TYPE_CHECKING:
    from arena.display.signers import Signers
    from arena.records.journal import Header, Seals

_MOST_ROWS = 20
replay = typer.Typer(no_args_is_help=True, help="Look at journals, or check them.")


@replay.command("verify")
def verify_journals(
    files: Annotated[list[Path], typer.Argument(metavar="FILE|FOLDER...", help="Journals, or folders or bundles of them.")],
    pit: Annotated[
        str, typer.Option(metavar="KEY|ADDRESS", help="The pit that must have signed: its key, or arena:// address.")
    ] = "",
    entry: Annotated[
        list[str] | None, typer.Option(metavar="NAME=KEY", help="The key that this entry must have; may be given again.")
    ] = None,
    is_local: Annotated[
        bool,
        typer.Option("--local", help="Take journals that no pit signed: those of arena play, and of leagues in the local venue."),
    ] = False,
    transcript: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Check as well that this seat saw the match of the journal.")
    ] = None,
    data: Annotated[
        Path | None, typer.Option(metavar="DIR", help="The data folder of your own pit or leagues, to know their keys.")
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Play journals again, compare every tick, and check who signed them; exit 1 if one does not hold.

    Anyone can play a match with keys of their own, under any names. So the keys of the pit and of the entries are shown: those
    that this machine knows by where it knows them from, all others as unknown. Name those that you rely on.
    """
    from platformdirs import user_data_path

    from arena.compiling import compile_rules
    from arena.display.signers import Signers, read_named
    from arena.records.journal_folder import find_journals

    if is_local and (pit or entry):
        raise InputError("--local takes journals that nobody signed, so there is no key to compare with --pit and --entry")
    named = read_named(pit, entry or [])
    signers = Signers(named, data or user_data_path("arena"))
    paths = list(find_journals(files))
    if transcript is not None and len(paths) != 1:
        raise InputError(f"--transcript is of one match, and there are {len(paths)} journals; name the journal of that match")
    compile_rules()
    checks = [_check(path, transcript, signers, is_local=is_local) for path in paths]
    unmet = named.entries.keys() - {check["keys"][team]["name"] for check in checks if check["keys"] for team in ("blue", "red")}
    if unmet:
        raise InputError(f"--entry names {min(unmet)!r}, who plays in none of these journals")
    broken = [check for check in checks if not check["ok"]]
    if as_json:
        print_json(checks[0] if len(checks) == 1 and not files[0].is_dir() else checks)
    else:
        _print_checks(checks, broken)
    if broken:
        raise typer.Exit(1)


def _print_checks(checks: list[dict[str, Any]], broken: list[dict[str, Any]]) -> None:
    if len(checks) <= _MOST_ROWS or broken:
        print_table(
            ("journal", "ok", "ticks", "signed", "canonical hash, or what is wrong"),
            [
                (
                    check["file"],
                    check["ok"],
                    check["ticks"],
                    _format_signatures(check["seals"]),
                    check.get("error") or check["canonical_hash"],
                )
                for check in (checks if len(checks) <= _MOST_ROWS else broken)
            ],
        )
    n_journals = Counter(
        ("the pit" if who == "pit" else f"entry {key['name']}", key["known_as"] or "unknown key", key["key"])
        for check in checks
        if check["keys"]
        for who, key in check["keys"].items()
    )
    if n_journals:
        rows = [(who, n, f"{known} {key}") for (who, known, key), n in sorted(n_journals.items())]
        print_table(("who", "journals", "key"), rows[::-1])
    say(f"{len(checks) - len(broken)} of {len(checks)} journals hold")


def _check(path: Path, transcript: Path | None, signers: "Signers", *, is_local: bool) -> dict[str, Any]:
    """Return what `--json` prints of one journal."""
    from arena.records.journal_folder import load_journal
    from arena.records.replay import BrokenChainError, verify
    from arena.records.transcript import load_transcript
    from arena.records.verification import check_seals, compare

    facts: dict[str, Any] = {"file": str(path), "ok": False, "ticks": 0, "canonical_hash": None, "seals": None, "keys": None}
    try:
        journal = load_journal(path)
        facts["canonical_hash"] = journal.canonical_hash
        checked = check_seals(journal)  # which plays a sealed journal again
        if checked is None:
            verify(journal)
        facts["ticks"] = len(journal.ticks)
        if checked is not None and journal.seals is not None:
            receipts = {team.name.lower(): standing.value for team, standing in checked.receipts.items()}
            facts["seals"] = {"pit": checked.signature.value, "commitment": checked.commitment.value, "receipts": receipts}
            if not checked.is_sound:
                return facts | {"error": "it was signed by others than it says, or the pit broke its commitment"}
            facts["keys"] = _describe_keys(journal.header, journal.seals, signers, path)
            impostor = signers.find_impostor(journal.header, journal.seals, path)
            if impostor:
                return facts | {"error": impostor}
        if not is_local and (checked is None or not checked.is_signed):
            return facts | {"error": "no pit signed it; if it was played without one, on a machine that you trust, add --local"}
        difference = "" if transcript is None else compare(journal, load_transcript(transcript))
        return facts | ({"error": difference} if difference else {"ok": True})
    except BrokenChainError as error:
        return facts | {"ticks": error.tick, "error": str(error)}
    except InputError as error:
        return facts | {"error": str(error)}


def _describe_keys(header: "Header", seals: "Seals", signers: "Signers", path: Path) -> dict[str, dict[str, str | None]]:
    """Return the pit's and the entries' public keys, and where each is known from."""
    from arena.game.types import Team
    from arena.protocol.identity import to_text

    named = (
        ("pit", None, seals.pit_key),
        ("blue", header.blue, seals.entries[Team.BLUE]),
        ("red", header.red, seals.entries[Team.RED]),
    )
    return {
        who: {**({} if name is None else {"name": name}), "key": to_text(key), "known_as": signers.describe(key, path)}
        for who, name, key in named
    }


def _format_signatures(seals: dict[str, Any] | None) -> str:
    """Return a cell on who signed."""
    if seals is None:
        return "by nobody"
    parts = {"pit": seals["pit"], **seals["receipts"]}
    bad = [f"{who} {standing}" for who, standing in parts.items() if standing != "holds"]
    return ", ".join(bad) if bad else "by pit, blue and red"


@replay.command("list")
def list_journals(
    files: Annotated[list[Path], typer.Argument(metavar="FILE|FOLDER...", help="Folders of journals, or bundles of them.")],
    as_json: AsJson = False,
) -> None:
    """Print the path of every journal, a line each; one in a bundle has a path like a file, which every command takes."""
    from arena.records.journal_folder import find_journals

    paths = [str(path) for path in find_journals(files)]
    if as_json:
        print_json(paths)
    else:
        say(*paths)


@replay.command("show")
def show_match(
    file: Annotated[Path, typer.Argument(help="A journal, or the transcript of a seat.")],
    team: Annotated[
        str | None, typer.Option(help="Whose view of a journal stands at the left: blue (without it) or red.")
    ] = None,
    tick: Annotated[int | None, typer.Option(help="Show this tick alone.")] = None,
    speed: Annotated[float, typer.Option(min=0.1, max=1000.0, help="Ticks per second, on a terminal.")] = 8.0,
    is_plain: Annotated[bool, typer.Option("--plain", help="Print every tick, as where stdout is no terminal.")] = False,
) -> None:
    """Look at a match in the terminal: of a journal, a team's view at the left and the truth at the right.

    Of a transcript, what its seat saw, remembered, ordered, logged and drew, and at the end what befell it. On a terminal, keys
    step through it, and ? tells which. They find fights, falls and captures in a journal, and in a transcript, which tells of no
    fight, losses and changes of the score. Where stdout is no terminal, every tick is printed.
    """
    from rich.console import Console
    from rich.text import Text

    from arena.compiling import compile_rules
    from arena.console import clean
    from arena.display.player import Recording
    from arena.display.recorded import open_match
    from arena.display.team_option import read_team
    from arena.display.terminal_replay import has_keys, play_with_keys, print_scenes
    from arena.display.text import is_live

    match = open_match(file, read_team(team, file))
    if not match.is_of_one_seat:  # a journal is played again
        compile_rules()
    console = Console(force_terminal=False if is_plain else None)
    if not is_live(console):
        console.width = 10_000
    if tick is None and has_keys(console):
        play_with_keys(console, Recording(match.scenes, match.last), match.views, speed)
    else:
        print_scenes(console, match.scenes, match.views[0], match.last, tick, speed, has_orders=match.is_of_one_seat)
    if tick is None:
        for line in match.epilogue:
            console.print(Text(clean(line)))
