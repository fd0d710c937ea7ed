"""Checkpoints: whole or not there, refused with a sentence where they do not fit, and playable as any fighter."""

import json
import resource
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import pytest
import torch
from safetensors.torch import load_file, save_file

from arena.envs.batched import BatchedEnv
from arena.errors import ArenaError, PolicyError
from arena.game.ruleset import load as load_rules
from arena.game.types import Code, Team
from policies.networks import checkpoint
from policies.networks.checkpoint import Manifest, load_checkpoint, read_manifest, save_checkpoint, shape_of
from policies.networks.features import FEATURES_VERSION
from policies.networks.models import PaperTeam, TeamNetwork, TeamShape
from policies.registry import load

PAPER = load_rules("paper")
SMALL = TeamShape(channels=8, blocks=1, patch=5, local=8, hidden=16)


def manifest_of(network: torch.nn.Module) -> Manifest:
    kind, shape = shape_of(network)
    return Manifest(network=kind, shape=shape, features=FEATURES_VERSION, ruleset=PAPER.name, ruleset_hash=PAPER.hash)


@pytest.fixture
def saved(tmp_path: Path) -> Path:
    torch.manual_seed(1)
    network = TeamNetwork(SMALL)
    save_checkpoint(tmp_path / "small.safetensors", network.state_dict(), manifest_of(network))
    return tmp_path / "small.safetensors"


def rewritten(path: Path, **changes: object) -> Path:
    """Write the file again with other facts in its manifest."""
    facts = {"format": checkpoint.FORMAT, **asdict(read_manifest(path)), **changes}
    save_file(load_file(path), path, {"arena": json.dumps(facts)})
    return path


def test_a_checkpoint_comes_back_as_it_was(saved: Path) -> None:
    torch.manual_seed(1)
    network = TeamNetwork(SMALL)

    back = load_checkpoint(saved)

    assert back.manifest == manifest_of(network)
    for name, tensor in network.state_dict().items():
        assert torch.equal(back.network.state_dict()[name], tensor)


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"format": 99}, "format 99"),
        ({"features": FEATURES_VERSION + 1}, "features of version"),
        ({"network": "transformer"}, "'transformer'"),
        ({"shape": {**asdict(SMALL), "channels": 16}}, "its network wants"),
        ({"shape": {"depth": 3}}, "depth"),
        ({"shape": {**asdict(SMALL), "patch": 4}}, "no network of the kind team has the sizes .*'patch': 4"),
        ({"shape": {**asdict(SMALL), "channels": -1}}, "has the sizes .*'channels': -1"),
        ({"shape": {**asdict(SMALL), "blocks": True}}, "has the sizes .*'blocks': True"),
        ({"shape": {**asdict(SMALL), "hidden": "h" * 10**6}}, "has the sizes .{10,200}$"),
        ({"shape": None}, "manifest .* cannot be read"),
        ({"ruleset": ["paper"]}, "manifest .* cannot be read"),
        ({"colour": "red"}, "manifest"),
    ],
)
def test_a_file_that_does_not_fit_is_refused_with_the_reason(saved: Path, changes: dict[str, object], reason: str) -> None:
    with pytest.raises(PolicyError, match=reason) as refusal:
        load_checkpoint(rewritten(saved, **changes))

    assert "\n" not in str(refusal.value)


@pytest.mark.parametrize(
    "shape",
    [
        {**asdict(SMALL), "channels": checkpoint.MOST_SIZE, "blocks": checkpoint.MOST_SIZE},
        {**asdict(SMALL), "channels": 10**9},
        {**asdict(SMALL), "blocks": 10**9},
    ],
)
def test_a_small_file_that_claims_a_large_network_takes_no_memory_for_it(saved: Path, shape: dict[str, int]) -> None:
    """Its largest would take 77 GB."""
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    with pytest.raises(PolicyError):
        load_checkpoint(rewritten(saved, shape=shape))

    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 200_000, "kB"


def test_a_manifest_without_end_is_refused(saved: Path) -> None:
    save_file(load_file(saved), saved, {"arena": "[" * 10**5})

    with pytest.raises(PolicyError, match=r"manifest .* cannot be read"):
        load_checkpoint(saved)


@pytest.mark.parametrize("kind", [torch.float8_e4m3fn, torch.complex64, torch.int8, torch.bool])
def test_weights_of_another_kind_are_refused(saved: Path, kind: torch.dtype) -> None:
    weights, facts = load_file(saved), {"format": checkpoint.FORMAT, **asdict(read_manifest(saved))}
    save_file({**weights, "trunk.stem.bias": weights["trunk.stem.bias"].to(kind)}, saved, {"arena": json.dumps(facts)})

    with pytest.raises(PolicyError, match=f"trunk.stem.bias is of {kind}; a network has floating-point numbers"):
        load_checkpoint(saved)


def test_what_is_no_checkpoint_is_refused(tmp_path: Path, saved: Path) -> None:
    data = saved.read_bytes()
    (tmp_path / "cut.safetensors").write_bytes(data[: len(data) // 2])
    (tmp_path / "bare.safetensors").write_bytes(b"hello")
    save_file({"a": torch.zeros(1)}, tmp_path / "foreign.safetensors")

    for name, reason in (("cut", "cut short"), ("bare", "no safetensors"), ("foreign", "no manifest"), ("none", "cannot read")):
        with pytest.raises(PolicyError, match=reason):
            load(str(tmp_path / f"{name}.safetensors"))


def test_weights_that_are_not_numbers_are_refused(saved: Path, tmp_path: Path) -> None:
    weights = load_file(saved)
    weights["trunk.stem.bias"][0] = torch.nan
    save_checkpoint(saved, weights, read_manifest(saved))

    with pytest.raises(PolicyError, match="not finite"):
        load_checkpoint(saved)


def test_a_tensor_too_few_or_too_many_is_named(saved: Path) -> None:
    weights, manifest = load_file(saved), read_manifest(saved)
    save_checkpoint(saved, {**weights, "extra": torch.zeros(1)}, manifest)
    with pytest.raises(PolicyError, match="unknown tensor 'extra'"):
        load_checkpoint(saved)

    del weights["trunk.stem.bias"]
    save_checkpoint(saved, weights, manifest)
    with pytest.raises(PolicyError, match=r"lacks the tensor 'trunk\.stem\.bias'"):
        load_checkpoint(saved)


def test_a_checkpoint_that_is_too_large_is_not_written(tmp_path: Path, saved: Path) -> None:
    before = saved.read_bytes()
    with pytest.raises(ArenaError, match="is the most"):
        save_checkpoint(saved, {"large": torch.zeros(checkpoint.MOST_BYTES // 4)}, read_manifest(saved))

    assert saved.read_bytes() == before


def test_a_checkpoint_of_a_window_that_holds_the_whole_board_comes_back(tmp_path: Path) -> None:
    network = PaperTeam(window=39, edge=Code.OBSTACLE)
    save_checkpoint(tmp_path / "wide.safetensors", network.state_dict(), manifest_of(network))

    back = load_checkpoint(tmp_path / "wide.safetensors").network

    assert isinstance(back, PaperTeam)
    assert (back.window, back.edge) == (39, Code.OBSTACLE)


def test_a_checkpoint_of_the_paper_that_does_not_name_its_edge_shows_it_as_hidden(tmp_path: Path) -> None:
    network = PaperTeam(7)
    save_checkpoint(tmp_path / "old.safetensors", network.state_dict(), manifest_of(network))

    old = load_checkpoint(rewritten(tmp_path / "old.safetensors", shape={"window": 7, "agents": 1, "planes": 1})).network

    assert isinstance(old, PaperTeam)
    assert old.edge == Code.HIDDEN
    with pytest.raises(PolicyError, match="no network of the kind paper"):
        load_checkpoint(rewritten(tmp_path / "old.safetensors", shape={"window": 7, "agents": 1, "planes": 1, "edge": 3}))


def test_a_disk_that_refuses_leaves_what_was_there(saved: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(_: int) -> None:
        raise OSError(28, "No space left on device")

    before = saved.read_bytes()
    monkeypatch.setattr(checkpoint.os, "fsync", full)
    with pytest.raises(ArenaError, match="No space left on device"):
        save_checkpoint(saved, load_file(saved), replace(read_manifest(saved), ruleset="other"))

    assert saved.read_bytes() == before
    assert [file.name for file in saved.parent.iterdir()] == [saved.name]


@pytest.mark.parametrize("kind", ["team", "paper", "planes", "signed"])
@pytest.mark.parametrize("rules", [{}, {"side": 16, "units": {"ugv": {"blue": 2}, "uav": {"blue": 0}}}])
def test_a_checkpoint_plays_as_any_fighter(tmp_path: Path, kind: str, rules: dict[str, object]) -> None:
    planes = {"paper": 1, "planes": len(Code), "signed": 6}
    network = TeamNetwork(SMALL) if kind == "team" else PaperTeam(planes=planes[kind])
    save_checkpoint(tmp_path / "one.safetensors", network.state_dict(), manifest_of(network))
    ruleset = PAPER.with_(rules)
    env, n_games = BatchedEnv(ruleset, 20, seed=5), 20
    sizes = {team: len(ruleset.team(team)) for team in Team}
    fighters = {team: load(str(tmp_path / "one.safetensors"))(ruleset, team, n_games) for team in Team}
    orders = {team: np.full((n_games, sizes[team]), -1, np.int8) for team in Team}
    used = set()
    for _ in range(12):
        seen = env.observe()
        for team in Team:
            fighters[team].act(seen[team], orders[team])
            used |= set(np.unique(orders[team]).tolist())
        turn = env.step(orders)
        for team in Team:
            fighters[team].start(np.flatnonzero(turn.has_ended))

    assert used == {0, 1, 2, 3, 4}


def test_a_seat_plays_the_same_again_from_the_same_observations(saved: Path) -> None:
    seen = BatchedEnv(PAPER, 4, seed=5).observe()[Team.RED]
    answers = []
    for _ in range(2):
        orders = np.zeros((4, 6), np.int8)
        load(str(saved))(PAPER, Team.RED, 4).act(seen, orders)
        answers.append(orders)

    np.testing.assert_array_equal(*answers)
