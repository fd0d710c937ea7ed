"""How a network plays: mirrored boards get mirrored chances, and a temperature says how they are drawn from."""

import json
from collections.abc import Callable
from dataclasses import asdict, replace
from pathlib import Path
from subprocess import CompletedProcess
from typing import Any

import numpy as np
import pytest
import torch
from numpy.typing import NDArray
from safetensors.torch import load_file, save_file

from arena.envs.batched import BatchedEnv
from arena.errors import PolicyError
from arena.game.observation import Observations
from arena.game.ruleset import load as load_rules
from arena.game.types import Team
from policies.networks import learned
from policies.networks.checkpoint import FORMAT, describe, load_checkpoint, read_manifest, save_checkpoint
from policies.networks.features import UPSIDE_DOWN
from policies.networks.first_person import turn_upside_down
from policies.networks.models import PaperTeam, TeamNetwork, TeamShape
from policies.networks.play_settings import PlaySettings, at_temperature
from policies.registry import load, set_more, split_settings
from policies.workers.files import resolve
from tournaments.league.entries import fingerprint_of, is_same_code, kind_of_file

PAPER = load_rules("paper")
N_GAMES, N_TICKS = 6, 12


def network_of(kind: str) -> TeamNetwork | PaperTeam:
    torch.manual_seed(1)
    made = TeamNetwork(TeamShape(channels=8, blocks=1, patch=5, local=8, hidden=16)) if kind == "team" else PaperTeam()
    for parameter in made.parameters():
        torch.nn.init.normal_(parameter, std=0.1)  # a fresh network takes all actions alike
    return made


@pytest.fixture(params=["team", "paper"])
def saved(request: pytest.FixtureRequest, tmp_path: Path) -> Path:
    network = network_of(request.param)
    file = tmp_path / "one.safetensors"
    save_checkpoint(file, network.state_dict(), describe(network, PAPER, {}))
    return file


def walk() -> list[dict[Team, Observations]]:
    """Return what both teams see in matches of units that wander."""
    env, rng, seen = BatchedEnv(PAPER, N_GAMES, seed=3), np.random.default_rng(0), []
    for _ in range(N_TICKS):
        seen.append({team: one.select(np.arange(N_GAMES)) for team, one in env.observe().items()})
        env.step({team: rng.integers(0, 5, (N_GAMES, 6)).astype(np.int8) for team in Team})
    return seen


def chances_of(spec: str, seen: list[Observations], monkeypatch: pytest.MonkeyPatch) -> NDArray[np.float32]:
    """Return what a fighter draws from, tick by tick."""
    drawn: list[NDArray[np.float32]] = []

    def note(logits: NDArray[np.float32], _seeds: object, actions: NDArray[np.int8]) -> None:
        drawn.append(torch.from_numpy(logits).softmax(-1).numpy())
        actions[:] = 0

    monkeypatch.setattr(learned, "choose", note)
    fighter = load(spec)(PAPER, seen[0].team, N_GAMES)
    for one in seen:
        fighter.act(one, np.zeros((N_GAMES, 6), np.int8))
    return np.stack(drawn)


def test_a_mirrored_observation_gets_the_mirrored_chances(saved: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for team in Team:
        seen = [one[team] for one in walk()]
        turned = [turn_upside_down(one) for one in seen]
        for setting, is_mirrored in (("mirror=true", True), ("mirror=false", False)):
            here = chances_of(f"{saved}:{setting}", seen, monkeypatch)
            there = chances_of(f"{saved}:{setting}", turned, monkeypatch)[..., UPSIDE_DOWN]
            assert np.allclose(here, there, atol=1e-4) == is_mirrored


def test_the_mean_is_of_log_probabilities_and_what_is_not_legal_stays_out(saved: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    seen = [one[Team.BLUE] for one in walk()]
    plain = chances_of(str(saved), seen, monkeypatch)
    turned = chances_of(str(saved), [turn_upside_down(one) for one in seen], monkeypatch)[..., UPSIDE_DOWN]
    mixed = np.sqrt(plain * turned)

    found = chances_of(f"{saved}:mirror=true", seen, monkeypatch)

    np.testing.assert_allclose(found, mixed / mixed.sum(-1, keepdims=True), atol=1e-4)
    assert not found[plain == 0].any()


def test_a_temperature_sharpens_what_is_drawn_from_down_to_the_likeliest() -> None:
    logits = np.log(np.array([[0.5, 0.25, 0.2, 0.05, 1e-9]], np.float32))

    def chances(temperature: float) -> NDArray[np.float32]:
        return torch.from_numpy(at_temperature(logits, temperature)).softmax(-1).numpy()

    np.testing.assert_array_equal(chances(0), [[1, 0, 0, 0, 0]])
    np.testing.assert_allclose(chances(1), np.exp(logits), atol=1e-6)
    np.testing.assert_allclose(chances(0.5)[0, 0] / chances(0.5)[0, 1], 4, rtol=1e-5)
    np.testing.assert_allclose(chances(2)[0, 0] / chances(2)[0, 1], 2**0.5, rtol=1e-5)


def test_greedy_play_does_not_depend_on_the_seed(saved: Path) -> None:
    seen = walk()[3][Team.RED]
    other = replace(seen, seed=seen.seed + np.uint64(0x9E3779B97F4A7C15))

    def answer(spec: str, one: Observations) -> NDArray[np.int8]:
        orders = np.zeros((N_GAMES, 6), np.int8)
        load(spec)(PAPER, Team.RED, N_GAMES).act(one, orders)
        return orders

    greedy = f"{saved}:temperature=0"
    np.testing.assert_array_equal(answer(greedy, seen), answer(greedy, other))
    assert (answer(str(saved), seen) != answer(str(saved), other)).any()


def test_a_checkpoint_is_played_as_its_manifest_says_and_settings_come_on_top(saved: Path) -> None:
    assert load(str(saved)).play == PlaySettings()  # type: ignore[attr-defined]  # of the factory of a network
    greedy = PlaySettings(temperature=0.0, mirror=True)
    save_checkpoint(saved, load_file(saved), replace(read_manifest(saved), play=greedy))

    assert load_checkpoint(saved).manifest.play == greedy
    assert load(str(saved)).play == greedy  # type: ignore[attr-defined]
    assert load(f"{saved}:temperature=0.5").play == replace(greedy, temperature=0.5)  # type: ignore[attr-defined]


def rewritten(file: Path, **changes: Any) -> Path:
    facts = {"format": FORMAT, **asdict(read_manifest(file)), **changes}
    save_file(load_file(file), file, {"arena": json.dumps({name: value for name, value in facts.items() if value is not None})})
    return file


def test_a_checkpoint_that_does_not_say_how_it_is_played_is_played_as_ever(saved: Path) -> None:
    assert load_checkpoint(rewritten(saved, play=None)).manifest.play == PlaySettings(temperature=1.0, mirror=False)


@pytest.mark.parametrize(
    ("play", "reason"),
    [
        ({"temperature": -1}, "temperature is -1; it must be a number from 0 to 100"),
        ({"temperature": float("nan")}, "temperature is nan"),
        ({"temperature": True}, "temperature is True"),
        ({"mirror": 1}, "mirror is 1; it must be true or false"),
        ({"depth": 1}, "manifest"),
        ([], "manifest"),
    ],
)
@pytest.mark.parametrize("saved", ["team"], indirect=True)
def test_a_manifest_that_cannot_be_played_is_refused_with_the_reason(saved: Path, play: object, reason: str) -> None:
    with pytest.raises(PolicyError, match=reason):
        load_checkpoint(rewritten(saved, play=play))


@pytest.mark.parametrize("saved", ["team"], indirect=True)
def test_a_checkpoint_with_settings_is_the_same_file_and_another_fighter(saved: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    spec = f"{saved}:mirror=true"

    assert set_more(spec, {"temperature": 0}) == f"{spec},temperature=0"
    assert split_settings(spec) == (str(saved), ":mirror=true")
    assert kind_of_file(spec) == "checkpoint"
    assert not is_same_code(fingerprint_of(spec), fingerprint_of(str(saved)))
    monkeypatch.chdir(saved.parent)
    assert resolve(f"{saved.name}:mirror=true") == (spec, [saved])


def test_what_evaluate_cannot_set_is_said_in_one_sentence(here: Callable[..., CompletedProcess[str]], tmp_path: Path) -> None:
    bot = tmp_path / "bot.py"
    bot.write_text("def act(observation): return [0] * len(observation.units)")
    for fighter, setting, reason in (
        ("champion", "play.temperature=-1", "champion: temperature is '-1'; it must be a number from 0 on"),
        ("champion", "play.temperature=101", "the temperature is 101.0; it must be a number from 0 to 100"),
        ("champion", "play.mirrors=true", "did you mean 'mirror'?"),
        ("champion", "play=3", "name what is to be set, as in --set play.temperature=0"),
        ("rush", "play.mirror=true", "rush has no settings"),
        (bot, "play.mirror=true", "has no settings"),
    ):
        done = here("evaluate", fighter, "--set", setting, "--against", "rush", "--pairs", 2)
        assert (done.returncode, done.stdout) == (2, "")
        assert reason in done.stderr
        assert done.stderr.count("\n") == 1
