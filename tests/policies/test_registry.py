import subprocess
import sys
from importlib.metadata import EntryPoint
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from arena.errors import PolicyError, UnknownNameError
from arena.game.ruleset import load as load_ruleset
from arena.game.types import Team
from arena.policy import BatchPolicy
from policies import registry
from policies.each_seat import EachSeat


@pytest.mark.parametrize("name", [*registry.OWN, *registry.shipped()])
def test_every_fighter_has_a_plan_in_one_line(name: str) -> None:
    assert 20 < len(registry.plan(name)) <= 130


def test_an_unknown_name_gets_the_nearest() -> None:
    with pytest.raises(UnknownNameError, match=r"unknown policy 'patroll'; did you mean 'patrol'\?"):
        registry.load("patroll")


@pytest.mark.parametrize(
    ("given", "meant"),
    [
        (["rush, patrol", "squad", "rush"], ["rush", "patrol", "squad"]),
        (["reflex:temperature=0,mirror=false,planner:2000"], ["reflex:temperature=0,mirror=false", "planner:2000"]),
        (["exec:fight --of a,b", "rush"], ["exec:fight --of a,b", "rush"]),
        ([" , "], []),
    ],
)
def test_several_fighters_are_named_in_one_option_or_in_several(given: list[str], meant: list[str]) -> None:
    assert registry.read_specs(given) == meant


def test_a_name_that_is_too_long_for_a_file_is_unknown() -> None:
    with pytest.raises(UnknownNameError, match="unknown policy 'xxx"):
        registry.load("x" * 300)


def test_of_a_folder_the_file_is_to_be_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "wolf").mkdir()

    with pytest.raises(PolicyError, match=r"^wolf is a folder; name the bot's file in it, as in wolf/bot\.py$"):
        registry.load("wolf")


def test_a_file_is_a_fighter(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "path", list(sys.path))
    file = tmp_path / "mine.py"
    file.write_text("def act(observation): return [0] * len(observation.units)")

    assert isinstance(registry.load(str(file))(load_ruleset("paper"), Team.RED, 2), EachSeat)


class Stranger(BatchPolicy):
    def act(self, observations: Any, orders: Any) -> None:
        orders[:] = 0


class OneSeat:
    def act(self, observation: Any) -> list[int]:
        return []


def act(observation: Any) -> list[int]:
    return []


@pytest.fixture
def install(monkeypatch: pytest.MonkeyPatch) -> Any:
    def as_installed(name: str, value: str) -> None:
        monkeypatch.setitem(sys.modules, "a_stranger", SimpleNamespace(Stranger=Stranger, OneSeat=OneSeat, act=act, NUMBER=5))
        entry = EntryPoint(name=name, value=value, group=registry.GROUP)
        monkeypatch.setattr(registry, "_installed", lambda: {name: entry})

    return as_installed


@pytest.mark.parametrize("kind", ["Stranger", "OneSeat", "act"])
def test_an_installed_fighter_of_any_kind_is_known(install: Any, kind: str) -> None:
    install("stranger", f"a_stranger:{kind}")

    policy = registry.load("stranger")(load_ruleset("paper"), Team.BLUE, 1)

    assert isinstance(policy, BatchPolicy)
    assert "stranger" in registry.names()
    assert registry.plan("stranger").startswith("from ")


@pytest.mark.parametrize(("value", "says"), [("no_such_module:X", "cannot be loaded"), ("a_stranger:NUMBER", "is neither")])
def test_an_installed_fighter_that_cannot_play_is_refused(install: Any, value: str, says: str) -> None:
    install("stranger", value)

    with pytest.raises(PolicyError, match=says):
        registry.load("stranger")


def test_nobody_replaces_a_fighter_of_ours(install: Any) -> None:
    install("rush", "a_stranger:Stranger")

    assert registry.load("rush") is not Stranger


def test_the_registry_and_its_plans_load_nothing_heavy() -> None:
    code = (
        "import policies, sys; from policies import registry; [registry.plan(name) for name in registry.names()];"
        "print([name for name in ('torch', 'zenoh', 'numba') if name in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=Path(__file__).parents[2])

    assert done.stdout.strip() == "[]"


def without(package: str, code: str) -> subprocess.CompletedProcess[str]:
    """Run code in a process that cannot import a package."""
    code = f"import sys; sys.modules[{package!r}] = None; {code}"
    return subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)


def command(*arguments: str) -> str:
    return f"from tournaments.cli import main; sys.argv = ['arena', *{arguments!r}]; main()"


@pytest.mark.parametrize("arguments", [("policies",), ("play", "rush", "patrol", "--pairs", "1", "--workers", "1")])
def test_scripts_need_no_torch(arguments: tuple[str, ...]) -> None:
    done = without("torch", command(*arguments))

    assert done.returncode == 0, done.stderr
    assert "rush" in done.stdout


@pytest.mark.parametrize(
    ("package", "arguments", "who", "extra"),
    [
        ("torch", ("play", "champion", "rush"), "the fighter champion", "learned"),
        ("safetensors", ("evaluate", "champion"), "the fighter champion", "learned"),
        ("torch", ("train",), "arena train", "train"),
    ],
)
def test_who_lacks_an_extra_gets_one_sentence(package: str, arguments: tuple[str, ...], who: str, extra: str) -> None:
    done = without(package, command(*arguments))

    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == f"arena: {who} needs {package}, which is not installed here: pip install 'arena-pit[{extra}]'\n"


@pytest.mark.parametrize(
    ("package", "code"),
    [
        ("gymnasium", "import policies.environments"),
        ("gymnasium", "from arena.envs import VectorCapture"),
        ("pettingzoo", "from arena.envs import ParallelCapture"),
    ],
)
def test_an_environment_without_its_packages_names_the_command(package: str, code: str) -> None:
    done = without(package, code)

    assert done.returncode != 0
    assert done.stderr.endswith(f"needs {package}, which is not installed here: pip install 'arena-pit[envs]'\n")
