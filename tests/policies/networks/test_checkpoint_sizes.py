"""The sizes of a network in a checkpoint: whole numbers alone, and refused in time where no checkpoint can hold it."""

import json
from dataclasses import asdict
from pathlib import Path

import pytest
from safetensors.torch import save_file

from arena.errors import InputError, PolicyError
from arena.game.ruleset import load as load_rules
from policies.networks.checkpoint import (
    FORMAT,
    MOST_BYTES,
    MOST_SIZE,
    build_network,
    check_size,
    describe,
    load_checkpoint,
    save_checkpoint,
    shape_of,
)
from policies.networks.models import PaperTeam, TeamNetwork, TeamShape

PAPER = load_rules("paper")


@pytest.mark.parametrize(("name", "size"), [("planes", 1.0), ("planes", True), ("edge", 9.0), ("edge", True), ("window", 20.0)])
def test_a_size_that_is_no_whole_number_is_refused_in_a_sentence(tmp_path: Path, name: str, size: object) -> None:
    network = PaperTeam(window=7)
    _, shape = shape_of(network)
    facts = {"format": FORMAT, **asdict(describe(network, PAPER, {})), "shape": {**shape, name: size}}
    save_file(network.state_dict(), tmp_path / "odd.safetensors", {"arena": json.dumps(facts)})

    with pytest.raises(PolicyError, match=f"no network of the kind paper has the sizes .*'{name}': {size}"):
        load_checkpoint(tmp_path / "odd.safetensors")


@pytest.mark.parametrize("n_planes", [1, 6])
def test_a_network_of_the_paper_is_built_of_whole_numbers(n_planes: int) -> None:
    _, shape = shape_of(PaperTeam(window=7, planes=n_planes))

    assert shape_of(build_network("paper", shape)) == ("paper", shape)


@pytest.mark.parametrize(
    ("shape", "reason"),
    [
        (TeamShape(channels=300), "channels=300 and blocks=3 would take .* bytes .*; 12,000,000 is the most, so choose fewer"),
        (TeamShape(blocks=10**9), "channels=48 and blocks=1000000000 cannot be kept .*; no size may be above 1,024$"),
        (TeamShape(channels=10**9), "channels=1000000000 and blocks=3 cannot be kept"),
        (TeamShape(channels=MOST_SIZE, blocks=MOST_SIZE), "would take"),
    ],
)
def test_a_network_that_no_checkpoint_can_hold_is_refused_with_the_way_out(shape: TeamShape, reason: str) -> None:
    with pytest.raises(InputError, match=reason):
        check_size(shape)


def test_the_largest_network_that_is_let_through_can_be_saved(tmp_path: Path) -> None:
    def is_let_through(channels: int) -> bool:
        try:
            check_size(TeamShape(channels=channels))
        except InputError:
            return False
        return True

    most = max(channels for channels in range(200, 301) if is_let_through(channels))
    network = TeamNetwork(TeamShape(channels=most))
    file = tmp_path / "large.safetensors"
    save_checkpoint(file, network.state_dict(), describe(network, PAPER, {"settings": "x" * 10_000}))

    assert 0.98 * MOST_BYTES < file.stat().st_size <= MOST_BYTES
