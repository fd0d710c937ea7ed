"""Trials: plans that are tried in a learner's place, kept in files; and learning from them what plans are worth."""

import csv
from collections.abc import Callable
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import pytest
import torch
from small import PAPER

from arena.errors import ArenaError, InputError
from arena.game.types import Team
from policies.networks.appraiser import Appraiser
from policies.networks.checkpoint import describe, load_checkpoint, save_checkpoint
from policies.networks.features import ONE, Plane, Scalar
from policies.networks.play_settings import PlaySettings
from policies.registry import load as load_fighter
from policies.search.climb import BEST, BLUEPRINT, LAST, N_PLANS, PRESETS, TRIALS
from policies.search.models import Role
from policies.search.plans import FROM_ROLE
from policies.search.strategist import Strategist, fresh_shape
from policies.search.trials import UNTRIED
from policies.training.appraise_run import AppraiseRun
from policies.training.appraise_settings import AppraiseSettings
from policies.training.budget import Budget
from policies.training.folder import LAST as LAST_FILE
from policies.training.folder import METRICS, RunFolder
from policies.training.gather import gather_alone
from policies.training.parallel import Processes
from policies.training.trials import TrialFolder, Trials, mirrored
from policies.training.try_plans import PlanTrier, TrialSettings, check, try_in_matches

EASY = TrialSettings(games=3, worlds=1, opponents={"rush": 0.5, "patrol": 0.5})
SMALL_RUN = ("--set", "channels=8", "--set", "blocks=1", "--set", "passes=1")
WALKERS, FLYERS = slice(0, 4), slice(4, 6)


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> TrialFolder:
    """Three files against `rush` and `patrol`; the second is not learned from."""
    folder = TrialFolder(tmp_path_factory.mktemp("trials"))
    folder.open_for(asdict(EASY), PAPER)
    for sitting in range(3):
        gather_alone(folder, PlanTrier, EASY, 0, sitting, 3, lambda: False)
    return folder


@pytest.fixture
def student(tmp_path: Path) -> str:
    torch.manual_seed(0)
    network = Appraiser(fresh_shape(channels=8, blocks=1))
    save_checkpoint(tmp_path / "student.safetensors", network.state_dict(), describe(network, PAPER, {}))
    return str(tmp_path / "student.safetensors")


def test_a_sample_tells_what_each_plan_that_was_tried_is_worth(data: TrialFolder) -> None:
    for file in data.files():
        samples = data.read(file.path)
        is_tried = samples.value != UNTRIED
        n_presets = is_tried[:, PRESETS:TRIALS].sum(1)

        assert len(samples.value) == file.samples
        assert is_tried[:, :PRESETS].all()
        assert is_tried[:, TRIALS:].all()
        assert set(n_presets.tolist()) <= {1, 2, 3}
        assert ((samples.value[is_tried] >= 0) & (samples.value[is_tried] <= 1)).all()
        assert samples.value[is_tried].std() > 0.1
        np.testing.assert_allclose(samples.likely.sum(1), 1, atol=1e-5)


def test_what_is_tried_is_the_blueprint_and_whatever_is_near_the_best(data: TrialFolder) -> None:
    samples = data.read(data.files()[0].path)
    other_role = samples.role != samples.role[:, BEST : BEST + 1]
    other_first = samples.first != samples.first[:, BEST : BEST + 1]
    differs = (other_role | other_first).sum(2)

    assert (samples.first[:, BLUEPRINT] != FROM_ROLE).all()
    assert (samples.first[:, PRESETS:TRIALS] == FROM_ROLE).all()
    has_last = samples.scalars[:, Scalar.TIME] > 0
    assert (samples.first[has_last, LAST] == FROM_ROLE).all()
    singles, steps = differs[:, TRIALS : TRIALS + 8], differs[:, TRIALS + 9 : N_PLANS - 1]
    assert set(np.unique(singles)) == {0, 1}
    assert set(np.unique(differs[:, TRIALS + 8])) == {0, 1, 2}
    assert set(np.unique(steps)) <= {0, 1}
    assert not other_role[:, TRIALS + 9 : N_PLANS - 1].any()
    assert differs[:, N_PLANS - 1].mean() > 3
    assert len(np.unique(samples.first[:, TRIALS + 9 : N_PLANS - 1])) == 6
    tried = samples.role[:, TRIALS:]
    assert not np.isin(tried[..., WALKERS], (Role.SCOUT, Role.WATCH, Role.FOLLOW)).any()
    assert np.isin(tried[..., FLYERS], (Role.SCOUT, Role.WATCH, Role.FOLLOW)).all()


def test_first_steps_are_those_of_the_frame(data: TrialFolder) -> None:
    """Where the blueprint has a unit on foot go east, it does not stand at the frame's eastern edge, nor before an obstacle."""
    samples = data.read(data.files()[0].path)
    side = PAPER.side
    obstacle = samples.planes[..., Plane.OBSTACLE] == ONE
    n_moves = 0
    for action, (down, right) in {1: (-1, 0), 2: (0, 1), 3: (1, 0), 4: (0, -1)}.items():
        at, unit = np.nonzero((samples.first[:, BLUEPRINT, WALKERS] == action) & (samples.alive[:, WALKERS] == 1))
        row, column = np.divmod(samples.cell[at, unit], side)
        assert ((row + down >= 0) & (row + down < side) & (column + right >= 0) & (column + right < side)).all()
        assert not obstacle[at, row + down, column + right].any()
        n_moves += len(at)
    assert n_moves > 100


def test_mirrored_samples_are_the_same_plans_on_a_board_turned_upside_down(data: TrialFolder) -> None:
    samples = data.read(data.files()[0].path)
    everything = np.ones(len(samples.value), np.bool_)
    turned = mirrored(samples, everything)
    own = np.take_along_axis(
        turned.planes[..., Plane.OWN_UGV].reshape(len(everything), -1), turned.cell[:, WALKERS].astype(np.int64), 1
    )

    assert own[turned.alive[:, WALKERS] == 1].all()
    assert (turned.first != samples.first).any()
    np.testing.assert_array_equal(turned.first == FROM_ROLE, samples.first == FROM_ROLE)
    for same in (mirrored(turned, everything), mirrored(samples, ~everything)):
        for one, other in zip(same, samples, strict=True):
            np.testing.assert_array_equal(one, other)


def test_a_student_plays_what_it_values_most_but_where_it_strays(student: str) -> None:
    def play(stray: float) -> tuple[int, int]:
        trier = PlanTrier(replace(EASY, student=student, stray=stray), 0, 0)
        learner, played, n_same = trier._learner, [], 0
        step = trier._env.step
        trier._env.step = lambda orders: (played.append(orders[Team.BLUE].copy()), step(orders))[1]  # type: ignore[method-assign]
        chosen: list[np.ndarray] = []
        act = learner.act
        learner.act = lambda seen, orders: (act(seen, orders), chosen.append(orders.copy()))[0]  # type: ignore[method-assign]
        for _ in range(12):
            list(trier.play_tick())
        n_same = sum(int((one == other).all()) for one, other in zip(played, chosen, strict=True))
        return n_same, len(played)

    assert play(0.0) == (12, 12)
    assert play(1.0)[0] < 12


def learn(path: Path, data: TrialFolder, stop: Callable[[], bool] = lambda: False, **settings: float) -> AppraiseRun:
    path.mkdir(exist_ok=True)
    chosen = AppraiseSettings(data=[str(data.path)], channels=8, blocks=1, minibatch=64, **settings)  # type: ignore[arg-type]
    run = AppraiseRun(RunFolder(path), chosen, "", Budget(), Processes(), lambda *_: None)
    run.train(stop)
    return run


def test_a_run_learns_what_plans_are_worth_as_far_as_that_can_be_learned(tmp_path: Path, data: TrialFolder) -> None:
    """Here every guard is worth a tenth, and every unit that begins northwards costs a twentieth; and a few plans are untried."""
    clear, rng = TrialFolder(tmp_path / "clear"), np.random.default_rng(0)
    clear.open_for({}, PAPER)
    for file in data.files():
        samples = data.read(file.path)
        lives = samples.alive[:, None, :] == 1
        value = 0.4 + 0.1 * ((samples.role == Role.GUARD) & lives).sum(2) - 0.05 * ((samples.first == 1) & lives).sum(2)
        untried = rng.random(value.shape) < 0.2
        turned = samples._replace(value=np.where(untried, UNTRIED, value).astype(np.float32))
        clear.add(0, [mirrored_north(turned)])
    run = learn(tmp_path / "run", clear, passes=40.0, rate=5e-3, average=0.8)
    with (run.folder.path / METRICS).open(encoding="utf-8", newline="") as table:
        rows = list(csv.DictReader(table))

    assert run.progress >= 1
    assert float(rows[0]["unseen_explained"]) < 0.5
    assert float(rows[-1]["unseen_explained"]) > 0.8
    manifest = load_checkpoint(run.folder.path / LAST_FILE).manifest
    assert (manifest.training["method"], manifest.play) == ("appraise", PlaySettings(temperature=0.0))


def mirrored_north(samples: Trials) -> Trials:
    """Return the samples with those of north and south alike, since half of what is learned from is mirrored."""
    both = np.where(samples.first == 3, 1, samples.first).astype(np.int8)
    cost = 0.05 * ((samples.first == 3) & (samples.alive[:, None, :] == 1)).sum(2)
    value = np.where(samples.value == UNTRIED, UNTRIED, samples.value - cost)
    return samples._replace(first=both, value=value.astype(np.float32))


def test_a_run_that_was_stopped_ends_with_the_weights_of_one_that_was_not(tmp_path: Path, data: TrialFolder) -> None:
    asked = iter(range(10))
    learn(tmp_path / "stopped", data, lambda: next(asked) >= 1, passes=2.0)
    stopped = learn(tmp_path / "stopped", data, passes=2.0)
    whole = learn(tmp_path / "whole", data, passes=2.0)

    assert stopped.counts.step == whole.counts.step == 2
    for name, one in whole.average.items():
        torch.testing.assert_close(stopped.average[name], one, rtol=0, atol=0)


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"student": "rush"}, "the student is 'rush'; it must be a checkpoint's file, or one of champion"),
        ({"student": "reflex"}, "its network is of the kind team, and one of the kind appraiser is wanted"),
        ({"opponents": {"nobody": 1.0}}, "nobody"),
        ({"opponents": {"self": 1.0}}, "the setting opponents names self; name fighters, or a checkpoint's file"),
        ({"worlds": 65}, "the setting worlds is 65; it must be at most 64"),
        ({"stray": 1.5}, "the setting stray is 1.5"),
        ({"rules": "wide"}, "plans are tried on boards of up to 40 cells a side, and wide has 42"),
    ],
)
def test_who_cannot_play_or_learn_is_refused_in_a_sentence(tmp_path: Path, change: dict[str, object], reason: str) -> None:
    if change.get("rules") == "wide":
        (tmp_path / "wide.toml").write_text('base = "paper"\nside = 42\n')
        change = {"rules": str(tmp_path / "wide.toml")}
    with pytest.raises(ArenaError, match=reason):
        check(replace(EASY, **change))  # type: ignore[arg-type]


def test_a_run_does_not_begin_with_what_does_not_fit(tmp_path: Path, data: TrialFolder, student: str) -> None:
    with pytest.raises(InputError, match=r"learns from trials; give a folder by --data, `arena train try-plans` makes one$"):
        AppraiseSettings()
    with pytest.raises(InputError, match=r"there are no trials in .*; `arena train try-plans` makes some$"):
        learn(tmp_path / "run", TrialFolder(tmp_path))
    team = AppraiseSettings(data=[str(data.path)], channels=48, blocks=3)
    reflex = "policies/weights/reflex.safetensors"
    with pytest.raises(InputError, match="its network is of the kind team, and one of the kind appraiser is wanted"):
        AppraiseRun(RunFolder(tmp_path), team, reflex, Budget(), Processes(), lambda *_: None)
    other = AppraiseSettings(data=[str(data.path)])
    with pytest.raises(InputError, match=r"\(try --set channels=8 --set blocks=1\)$"):
        AppraiseRun(RunFolder(tmp_path), other, student, Budget(), Processes(), lambda *_: None)


def test_the_commands_make_trials_learn_from_them_and_what_comes_of_it_plays(
    train: Callable[..., None], tmp_path: Path, data: TrialFolder, capsys: pytest.CaptureFixture[str]
) -> None:
    train("--method", "appraise", "--data", data.path, "--out", tmp_path / "run", *SMALL_RUN)
    trained = tmp_path / "run" / LAST_FILE
    train("try-plans", "--out", tmp_path / "more", "--student", trained, "--matches", 2, "--processes", 1, "--set", "games=2",
          "--set", "opponents.champion=0", "--set", "opponents.planner-fast=0")  # fmt: skip
    said = capsys.readouterr().out
    fighter = load_fighter(str(trained))(PAPER, Team.RED, 1)

    assert f"trained: {trained}" in said
    assert f"trials: {tmp_path / 'more'}" in said
    assert sum(file.matches for file in TrialFolder(tmp_path / "more").files()) == 2
    assert isinstance(fighter, Strategist)
    with pytest.raises(SystemExit):
        train("--method", "distil", "--data", data.path, "--out", tmp_path / "other", *SMALL_RUN)
    assert f"there are no demonstrations in {data.path}" in capsys.readouterr().err


def test_what_was_tried_is_kept_when_it_is_stopped_and_the_same_command_goes_on(tmp_path: Path) -> None:
    folder, settings = TrialFolder(tmp_path / "data"), replace(EASY, file_samples=50)
    stopped = try_in_matches(folder, settings, 1000, 1, lambda *_: None, lambda: bool(folder.files()))
    kept = sum(file.matches for file in folder.files())

    assert not stopped
    assert 0 < kept < 1000
    assert try_in_matches(folder, settings, kept + 1, 1, lambda *_: None, lambda: False)
    assert sum(file.matches for file in folder.files()) == kept + 1
