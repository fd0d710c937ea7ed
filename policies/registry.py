"""Every fighter by its name: our own, those of others through the entry points `arena.policies`, bot files and programs.

What a worker process is sent is the name; it loads the fighter itself.
"""

import ast
import re
from collections.abc import Iterable, Mapping
from functools import cache
from importlib import import_module
from importlib.metadata import EntryPoint, entry_points
from importlib.resources import files
from pathlib import Path
from stat import S_ISDIR
from typing import Any

from arena.errors import PolicyError, UnknownNameError
from arena.extras import needs
from arena.files import mode_of
from arena.policy import BatchFactory, BatchPolicy
from policies.batch_bot import GuardedBatchFactory
from policies.bot_file import batch_policy, load_bot
from policies.each_seat import EachSeatFactory, WithoutMemory
from policies.program import PREFIX, load_program

GROUP = "arena.policies"
"""Entry points that name a `BatchPolicy`, a class with `act`, or a function `act(observation)`."""
OWN = {
    "random": "policies.heuristics.random:Random",
    "patrol": "policies.heuristics.patrol:Patrol",
    "defend": "policies.heuristics.defend:Defend",
    "roomba": "policies.heuristics.roomba:Roomba",
    "fighter": "policies.heuristics.fighter:Fighter",
    "rush": "policies.heuristics.rush:Rush",
    "spiral": "policies.heuristics.spiral:Spiral",
    "scout_rush": "policies.heuristics.scout_rush:ScoutRush",
    "role_team": "policies.heuristics.role_team:RoleTeam",
    "squad": "policies.heuristics.squad:Squad",
    "turtle": "policies.heuristics.turtle:Turtle",
    "border_hunter": "policies.heuristics.border_hunter:BorderHunter",
    "chameleon": "policies.heuristics.chameleon:Chameleon",
    "planner-fast": "policies.search.planner:PlannerFast",
    "planner": "policies.search.planner:Planner",
    "planner-deep": "policies.search.planner:PlannerDeep",
}
"""Our own fighters: module and class."""
PLANNERS = ("planner-fast", "planner", "planner-deep")
"""Those of our own that look ahead. They take milliseconds for a turn, and are one class with three budgets."""
SCRIPTS = tuple(name for name in OWN if name not in PLANNERS)
"""The others, which take microseconds."""
REFERENCES = {
    "oracle_rush": "policies.heuristics.oracle_rush:OracleRush",
    "oracle_planner": "policies.search.oracle_planner:OraclePlanner",
}
"""Cheats: the local venue shows them the whole board. They are never rated, and no other venue seats them."""
CHECKPOINT = ".safetensors"
_BETWEEN = re.compile(r",(?!\w+=)")
"""A comma that no setting follows."""
TRAINED = {
    "champion": "A network that says what a plan is worth, and chooses among some fifty a tick: taught by playouts.",
    "reflex": "A network that orders straight away, in one pass for all units: taught by scripts, itself and `planner-fast`.",
    "paper": "The network of the paper, trained by the paper's method: what the arena began with, and easily beaten.",
}
"""What the trained fighters that come with the arena are."""
NOT_PACKAGED = {
    "paper": "the weights of the fighter paper come with the source repository alone, since they have 10 MB: "
    "name a copy of its policies/weights/paper.safetensors instead, or train them with "
    "`arena train --method reinforce --curriculum paper`",
    "reflex": "the weights of the fighter reflex come with the source repository alone: name a copy of its "
    "policies/weights/reflex.safetensors instead, or play champion",
}
"""What to do about trained fighters that an installed package lacks."""


def load(spec: str, *, cheats: bool = False) -> BatchFactory:
    """Return the fighter that `spec` names: ours, an installed one, a file that ends in .py or .safetensors, or exec:COMMAND.

    Raises
    ------
    UnknownNameError
        No fighter has that name.
    PolicyError
        The fighter cannot be loaded, or is a cheat where `cheats` does not let it in.
    """
    if spec.startswith(PREFIX):
        return EachSeatFactory(load_program(spec.removeprefix(PREFIX)))
    if spec.endswith(".py"):
        bot = load_bot(spec)
        batch = batch_policy(bot)
        return EachSeatFactory(bot) if batch is None else GuardedBatchFactory(batch)
    base, settings = split_settings(spec)
    if settings:
        return _with_settings(base, settings.removeprefix(":"))
    if spec in REFERENCES and not cheats:
        raise PolicyError(f"{spec} is a cheat, shown the whole board; it plays in `arena play` alone, and is never rated")
    if spec in OWN or spec in REFERENCES:
        module, _, name = (OWN | REFERENCES)[spec].partition(":")
        fighter: type[BatchPolicy] = getattr(import_module(module), name)
        return fighter
    if spec.endswith(CHECKPOINT) or spec in shipped():
        with needs("learned", f"the fighter {spec}"):  # torch takes a second to import: only a network's player waits for it
            return _load_checkpoint(Path(spec) if spec.endswith(CHECKPOINT) else shipped()[spec])
    if spec in _installed():
        return make_factory(spec, _loaded(_installed()[spec]))
    if spec in NOT_PACKAGED:
        raise PolicyError(NOT_PACKAGED[spec])
    if S_ISDIR(mode_of(Path(spec))):
        raise PolicyError(f"{spec} is a folder; name the bot's file in it, as in {Path(spec) / 'bot.py'}")
    raise UnknownNameError("policy", spec, names())


def _load_checkpoint(path: Path) -> BatchFactory:
    from policies.networks.appraiser import Appraiser
    from policies.networks.checkpoint import load_checkpoint
    from policies.networks.learned import load_learned

    checkpoint = load_checkpoint(path)
    if isinstance(checkpoint.network, Appraiser):
        from policies.search.strategist import load_strategist

        return load_strategist(checkpoint, path)
    return load_learned(checkpoint, path)


def split_settings(spec: str) -> tuple[str, str]:
    """Return a fighter and the settings behind its name, as in planner:budget=2000 or best.safetensors:mirror=true.

    Only our own fighters, trained ones included, and checkpoints have settings. They come with their colon, or are empty.
    """
    base = spec.partition(":")[0]
    if not (base in OWN or base in shipped()):
        file, has_settings, _ = spec.partition(f"{CHECKPOINT}:")
        base = file + CHECKPOINT if has_settings and not spec.startswith(PREFIX) else spec
    return base, spec.removeprefix(base)


def read_specs(given: Iterable[str]) -> list[str]:
    """Return the fighters that an option names, each once; it may be repeated, and name several, divided by commas.

    The commas between settings, as in `reflex:temperature=0,mirror=false`, divide no names, nor do those in a program's command
    line (`exec:`), which stands alone.
    """
    specs = (spec.strip() for text in given for spec in ([text] if text.startswith(PREFIX) else _BETWEEN.split(text)))
    return list(dict.fromkeys(spec for spec in specs if spec))


def without_settings(spec: str) -> str:
    """Return a fighter without the settings behind its name."""
    return split_settings(spec)[0]


def set_more(spec: str, settings: Mapping[str, object]) -> str:
    """Return a fighter with more settings behind its name.

    Raises
    ------
    PolicyError
        Fighters of its kind have none.
    """
    text = ",".join(f"{name}={str(value).lower()}" for name, value in settings.items())
    base, already = split_settings(spec)
    more = f"{base}{already},{text}" if already else f"{base}:{text}"
    if without_settings(more) != base:
        raise PolicyError(f"{spec} has no settings, so there is none called {', '.join(settings)}")
    return more


def _with_settings(name: str, settings: str) -> BatchFactory:
    """Return a fighter of ours with other settings than it comes with."""
    fighter: Any = load(name)
    if not hasattr(fighter, "with_settings"):
        raise PolicyError(f"{name}:{settings} sets something, and {name} has no settings; leave out :{settings}")
    made: BatchFactory = fighter.with_settings(settings)
    return made


def check_name(spec: str) -> None:
    """Raise what `load` would raise for a name that no fighter has, without loading one."""
    if is_file_or_program(spec) or spec in OWN or spec in shipped() or spec in _installed():
        return
    load(spec)


def is_file_or_program(spec: str) -> bool:
    """Whether a fighter is code or weights that neither ship with the arena nor were installed with a package."""
    return spec.startswith(PREFIX) or without_settings(spec).endswith((".py", CHECKPOINT))


def load_entry(specs: Mapping[str, str], name: str, *, cheats: bool = False) -> BatchFactory:
    """Return the fighter behind an entry's name; a function of the module, so that workers can be sent it."""
    return load(specs[name], cheats=cheats)


def names() -> list[str]:
    """Return the name of every fighter, our own first; without the references."""
    own = [*OWN, *shipped()]
    return [*own, *sorted(set(_installed()) - set(own))]


@cache
def shipped() -> dict[str, Path]:
    """Return the files of the trained fighters that come with the arena, by name."""
    return {file.stem: file for file in sorted((Path(__file__).parent / "weights").glob(f"*{CHECKPOINT}"))}


def mark(spec: str) -> str:
    """Return the name under which tables and journals show a fighter: a cheat is called one."""
    return f"{spec}-cheat" if spec in REFERENCES else spec


def plan(name: str) -> str:
    """Return what a fighter is up to, in a line; nothing is imported for it."""
    if name in OWN or name in REFERENCES:
        module, _, fighter = (OWN | REFERENCES)[name].partition(":")
        package, _, file = module.rpartition(".")
        tree = ast.parse((files(package) / f"{file}.py").read_text(encoding="utf-8"))
        of_class = [node for node in tree.body if isinstance(node, ast.ClassDef) and node.name == fighter and name in PLANNERS]
        return (ast.get_docstring(of_class[0] if of_class else tree) or "").partition("\n")[0]
    if name in shipped():
        return TRAINED[name]
    if name in _installed():
        giver = _installed()[name].dist
        return f"from {giver.name} {giver.version}" if giver else f"from {_installed()[name].module}"
    raise UnknownNameError("policy", name, names())


@cache
def _installed() -> dict[str, EntryPoint]:
    return {entry.name: entry for entry in entry_points(group=GROUP)}


def _loaded(entry: EntryPoint) -> Any:
    try:
        return entry.load()
    except Exception as error:
        raise PolicyError(f"the policy {entry.name} ({entry.value}) cannot be loaded: {type(error).__name__}: {error}") from error


def make_factory(name: str, fighter: Any) -> BatchFactory:
    """Return the fighter that a `BatchPolicy`, a class with `act` or a function makes; `PolicyError` if it is none of these."""
    if isinstance(fighter, type):
        if issubclass(fighter, BatchPolicy):
            return fighter
        if callable(getattr(fighter, "act", None)):
            return EachSeatFactory(fighter)
    elif callable(fighter):
        bot = WithoutMemory(fighter)
        return EachSeatFactory(lambda: bot)
    raise PolicyError(f"the policy {name} is neither a BatchPolicy, nor a class with act, nor a function act(observation)")
