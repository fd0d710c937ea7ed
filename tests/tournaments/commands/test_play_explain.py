"""`arena play --explain`: what a planner thought is kept where somebody asks, and costs nothing where nobody does."""

import subprocess
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from arena.game.keys import secret_from_seed
from arena.game.observation import Observations
from arena.game.ruleset import Ruleset, load
from arena.game.types import Team
from arena.policy import BatchPolicy, Orders
from arena.records.transcript import load_transcript
from policies import registry
from policies.search.explain import Thought, WeighedPlan, explain
from tournaments.authoring.stepping import SteppedPlay
from tournaments.authoring.transcripts import load_transcribed
from tournaments.fixture import plan_fixture

Run = Callable[..., subprocess.CompletedProcess[str]]
OPTIONS = ("--pairs", 1, "--seed", 3, "--set", "tick_limit=6", "--workers", 1)
FILE = "play+thinker+rush+0000+thinker-blue+0+blue.transcript"


class Thinker(BatchPolicy):
    """Goes in circles, believes that one enemy stands anywhere that it does not see, and says so where it is asked to."""

    def __init__(self, ruleset: Ruleset, team: Team, n_seats: int) -> None:
        super().__init__(ruleset, team, n_seats)
        self._notes = [b""] * n_seats

    def act(self, observations: Observations, orders: Orders) -> None:
        orders[:] = observations.tick[:, None] % 5
        if self.keeps_annotations and self.explains:
            self._notes = [explain(self._think(int(tick))).pack() for tick in observations.tick]

    def take_annotations(self, seat: int) -> bytes:
        taken, self._notes[seat] = self._notes[seat], b""
        return taken

    def _think(self, tick: int) -> Thought:
        cells = np.arange(self.ruleset.side**2, dtype=np.int16)
        plans = [WeighedPlan(name=name, value=0.5, error=0.1, n_worlds=4) for name in ("wait", f"turn {tick}")]
        return Thought(
            side=self.ruleset.side,
            enemies=["ugv 0"],
            worlds=cells[:, None],
            in_sight=cells < 100,
            plans=plans,
            taken=1,
        )


@pytest.fixture
def thinker(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(registry.OWN, "thinker", f"{__name__}:Thinker")


@pytest.mark.usefixtures("thinker")
def test_its_transcripts_tell_what_it_thought_and_its_orders_are_the_same_as_without(here: Run, tmp_path: Path) -> None:
    journals, seats = [tmp_path / "a", tmp_path / "b"], [tmp_path / "silent", tmp_path / "told"]
    for kept, shown, options in zip(journals, seats, ([], ["--explain"]), strict=True):
        assert here("play", "thinker", "rush", *OPTIONS, "--journals", kept, "--transcripts", shown, *options).returncode == 0

    silent, told = (load_transcript(folder / FILE) for folder in seats)
    assert silent.ticks == told.ticks
    plain, explained = ({path.name: path.read_bytes() for path in folder.iterdir()} for folder in journals)
    assert plain == explained
    assert all(not notes["log"] and not notes["draw"] for notes in silent.annotations)
    for tick, notes in enumerate(told.annotations):
        assert notes["log"][2] == f"> 0.500 +-0.100    4  turn {tick}"
        [heat] = notes["draw"]
        assert heat["label"] == "ugv 0"
        assert heat["heat"] == bytes(100) + b"\xc0" * 300  # it is in sight in a quarter of the worlds
    other = load_transcript(seats[1] / FILE.replace("+blue.", "+red."))
    assert all(not notes["log"] for notes in other.annotations)


def test_a_planner_tells_what_it_believed_weighed_and_took_and_orders_the_same_without(here: Run, tmp_path: Path) -> None:
    for name, options in (("silent", []), ("told", ["--explain"])):
        given = ("--journals", tmp_path / name, "--transcripts", tmp_path / f"{name}-seats", *options)
        assert here("play", "planner-fast", "rush", *OPTIONS, *given).returncode == 0

    plain, explained = ({path.name: path.read_bytes() for path in (tmp_path / name).iterdir()} for name in ("silent", "told"))
    assert plain == explained
    file = FILE.replace("thinker", "planner-fast")
    silent, told = (load_transcript(tmp_path / f"{name}-seats" / file) for name in ("silent", "told"))
    assert not any(notes["log"] or notes["draw"] for notes in silent.annotations)
    first, n_enemies = next(told.observations()), len(load("paper").team(Team.RED))
    maps = [drawing["label"] for drawing in told.annotations[0]["draw"] if "label" in drawing]
    assert len(set(maps) - {"their flag"}) >= n_enemies - len(first.enemies)
    for notes in told.annotations:
        assert len([line for line in notes["log"] if line.startswith("> ")]) == 1
        assert any(line.startswith("weighed ") for line in notes["log"])


@pytest.mark.usefixtures("thinker")
def test_without_a_folder_it_says_where_it_keeps_them(here: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path))
    folder = tmp_path / "arena" / "transcripts" / "seed-3"

    done = here("play", "thinker", "rush", *OPTIONS, "--explain")

    assert f"what planners think is kept in {folder}; `arena replay show FILE` shows one match" in done.stderr
    assert len(list(folder.iterdir())) == 4
    shown = here("replay", "show", folder / FILE, "--tick", 2).stdout
    assert "log: > 0.500 +-0.100    4  turn 2" in shown


def test_it_wants_transcripts_and_they_want_no_clock(here: Run, tmp_path: Path) -> None:
    done = here("play", "rush", "defend", "--explain", "--transcripts", tmp_path, "--turn-time", 1)
    joined = here("join", "--explain", "--no-transcripts")

    assert (done.returncode, joined.returncode) == (2, 2)
    assert done.stderr == "arena: transcripts are kept without a clock; leave out --turn-time, or join a pit, which keeps them\n"
    assert joined.stderr == "arena: --explain writes into the transcripts of the matches; leave out --no-transcripts\n"


@pytest.mark.parametrize("is_transcribed", [False, True])
@pytest.mark.usefixtures("thinker")
def test_who_steps_through_a_match_is_told(is_transcribed: bool, tmp_path: Path) -> None:
    specs = {"thinker": "thinker", "rush": "rush"}
    loader = partial(registry.load_entry, specs)
    if is_transcribed:
        loader = partial(load_transcribed, loader, dict(zip(specs, reversed(specs), strict=True)), tmp_path, explains=False)
    [plan, _] = plan_fixture("play", "thinker", "rush", 1, secret_from_seed(5))

    scenes = list(SteppedPlay(load("paper").with_({"tick_limit": 3}), plan, loader, Team.BLUE, list).scenes())

    assert [scene.log[2:3] for scene in scenes] == [*((f"> 0.500 +-0.100    4  turn {tick}",) for tick in range(3)), ()]
