"""Play a bot as a pit would, and find what would go wrong for it in a league."""

from collections.abc import Callable, Sequence
from pathlib import Path
from stat import S_ISDIR, S_ISREG

from arena.errors import InputError
from arena.files import mode_of
from arena.game.ruleset import Ruleset
from arena.game.types import Team
from arena.match.time_control import TimeControl
from arena.sandbox.bubblewrap import why_no_limits, why_no_wall
from arena.sandbox.limits import BEHIND_A_WALL, Limits
from policies.registry import check_name, load, without_settings
from tournaments.authoring.checked_bot import N_REPLAYS, CheckedBot
from tournaments.authoring.findings import Report
from tournaments.league.entries import kind_of_file, name_of
from tournaments.running.preflight import PATIENCE_S

OPPONENTS = ("random", "rush", "defend", "squad")
"""Who walks anywhere, who attacks, who waits, and who thinks."""
MOST_S = 60.0
"""About how long a check takes at most, for a bot that is slow."""
DEFAULT_CLOCK = TimeControl()


def find_bot(name: str) -> str:
    """Return the fighter that the author names: as `policies.registry.load` takes it, or the `bot.py` of a folder.

    Raises
    ------
    InputError
        There is no such file, no bot in that folder, or no fighter of that name.
    """
    folder = Path(name)
    if S_ISDIR(mode_of(folder)):
        if not (folder / "bot.py").is_file():
            raise InputError(f"{name} is a folder without a bot.py; name the bot's file, or a program as exec:COMMAND")
        return str(folder / "bot.py")
    kind = kind_of_file(name)
    if kind is not None and not S_ISREG(mode_of(Path(without_settings(name)))):
        raise InputError(f"there is no {kind} {name}")
    check_name(name)
    return name


def count_matches(opponents: Sequence[str] = OPPONENTS) -> int:
    """Return how many matches a check plays."""
    return len(Team) * len(opponents) + N_REPLAYS


def check(
    spec: str,
    ruleset: Ruleset,
    *,
    time_control: TimeControl = DEFAULT_CLOCK,
    limits: Limits = BEHIND_A_WALL,
    has_wall: bool | None = None,
    opponents: Sequence[str] = OPPONENTS,
    most_s: float = MOST_S,
    patience_s: float = PATIENCE_S,
    advance: Callable[[int], None] = lambda _: None,
) -> Report:
    """Play a fighter as a pit would, and return what is found.

    Parameters
    ----------
    spec
        As `find_bot` returns it.
    has_wall
        Whether it plays behind a wall; without it, if this machine can build one.
    most_s
        Each match has its share of it, and is cut short after that.
    patience_s
        How long it may take to be ready to play.
    advance
        Called with the number of matches that were played since the last call.

    Raises
    ------
    InputError
        The file has no bot, or `has_wall` asks for a wall that cannot be built.
    """
    why = why_no_wall() or why_no_limits()
    checked = CheckedBot(
        spec, ruleset, time_control, limits,
        has_wall=why is None if has_wall is None else has_wall, opponents=[name_of(name) for name in opponents],
        patience_s=patience_s,
    )  # fmt: skip
    factory = checked.make(is_shared=True)
    try:
        load_s = checked.load(factory)
        if load_s is not None:
            checked.play_all(factory, [load(name) for name in opponents], most_s, advance)
    finally:
        factory.close()
    return checked.report(load_s, why if has_wall is None else None if has_wall else "it was not asked for")
