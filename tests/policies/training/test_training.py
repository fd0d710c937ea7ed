"""Training: what is learned from, that it is learned, and that a run which was killed goes on."""

import csv
import json
import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from small import FULL, PAPER, SETTINGS, SMALL, advantageous, make_learner, make_seats

from arena.envs.batched import BatchedEnv
from arena.errors import InputError, UnknownNameError
from arena.game.ruleset import load as load_rules
from arena.game.state import StateField
from arena.game.types import Team
from policies.networks.checkpoint import load_checkpoint
from policies.networks.models import TeamNetwork
from policies.training.allocator import KEEP
from policies.training.budget import Budget
from policies.training.clone import Teacher, collect_lesson, learn_lesson
from policies.training.folder import LAST, METRICS, START, STATE, RunFolder
from policies.training.folder import SETTINGS as SETTINGS_FILE
from policies.training.gradients import TrainingError
from policies.training.methods import read_config
from policies.training.opponents import Opponents, Pool, assign
from policies.training.parallel import Processes
from policies.training.ppo import estimate
from policies.training.ppo_run import PpoRun
from policies.training.ppo_settings import PpoSettings, from_dict
from policies.training.rollout import LearnerSeats, Results, collect


def test_rows_get_opponents_by_their_shares_however_many_processes_there_are() -> None:
    shares = {"self": 0.5, "rush": 0.3, "best": 0.2}
    whole = assign(shares, 0, 40)
    first, second = assign(shares, 0, 23), assign(shares, 23, 17)

    assert {name: len(rows) for name, rows in whole.items()} == {"self": 20, "rush": 12, "best": 8}
    for name in shares:
        np.testing.assert_array_equal(whole[name], np.concatenate([first[name], second[name] + 23]))


def test_a_rollout_is_the_same_in_one_process_and_in_parts() -> None:
    network = TeamNetwork(SMALL).eval()
    settings = replace(SETTINGS, opponents={"self": 0.5, "rush": 0.5})
    whole = collect(make_seats(settings), network, 6, Results())
    parts = [collect(make_seats(settings, first_row=first, n_rows=4), network, 6, Results()) for first in (0, 4)]

    np.testing.assert_array_equal(whole.planes[:, :8], torch.cat([part.planes[:, :4] for part in parts], 1))
    np.testing.assert_array_equal(whole.actions[:, :8], torch.cat([part.actions[:, :4] for part in parts], 1))


def test_advantages_are_discounted_surprises_and_stop_where_a_match_ends() -> None:
    settings = replace(SETTINGS, gamma=0.9, lambda_=0.5)
    experience = collect(make_seats(), TeamNetwork(SMALL).eval(), 5, Results())
    torch.manual_seed(3)
    has_ended = torch.rand(experience.has_ended.shape) < 0.3
    experience = replace(experience, reward=torch.randn(has_ended.shape), gain=torch.randn(has_ended.shape), has_ended=has_ended)
    values = torch.randn(6, has_ended.shape[1])

    advantages, returns = estimate(experience, values, replace(FULL, shaping=0.5), settings)

    for seat in range(has_ended.shape[1]):
        for tick in range(5):
            total, weight = 0.0, 1.0
            for later in range(tick, 5):
                ends = bool(has_ended[later, seat])
                reward = experience.reward[later, seat] + 0.5 * experience.gain[later, seat]
                total += weight * (reward + (0 if ends else 0.9 * values[later + 1, seat]) - values[later, seat])
                if ends:
                    break
                weight *= 0.9 * 0.5
            assert advantages[tick, seat] == pytest.approx(float(total), abs=1e-5)
            assert returns[tick, seat] == pytest.approx(float(total + values[tick, seat]), abs=1e-5)


def test_both_sides_of_self_play_earn_opposite_rewards() -> None:
    settings = replace(SETTINGS, opponents={"self": 1.0}, games=24)
    experience = collect(make_seats(settings), TeamNetwork(SMALL).eval(), 120, Results())

    assert torch.equal(experience.reward[:, :24], -experience.reward[:, 24:])
    assert torch.equal(experience.gain[:, :24], -experience.gain[:, 24:])
    assert experience.has_ended.any()
    assert experience.reward.abs().sum() > 0
    assert not experience.reward[~experience.has_ended].any()


def test_ppo_learns_what_pays() -> None:
    seats, learner, generator = (
        make_seats(),
        make_learner(replace(SETTINGS, target_kl=10.0, minibatch=12)),
        torch.Generator().manual_seed(0),
    )
    shares = []
    for _ in range(12):
        experience = collect(seats, learner.network.eval(), 6, Results())
        chosen = experience.actions[(experience.alive > 0) & (experience.legal[..., 3] > 0)]
        shares.append(float((chosen == 3).float().mean()))
        learner.learn(advantageous(experience, 3), seats.n_walkers, replace(FULL, rate=5e-3), generator)

    assert np.mean(shares[-2:]) > np.mean(shares[:2]) + 0.2


def test_while_the_critic_warms_up_the_policy_stays() -> None:
    seats, learner = make_seats(), make_learner()
    before = {name: one.clone() for name, one in learner.network.state_dict().items()}
    judged = learner.critic.out.bias.clone()
    experience = advantageous(collect(seats, learner.network.eval(), 6, Results()), 3)
    learner.learn(experience, seats.n_walkers, replace(FULL, is_critic_only=True), torch.Generator().manual_seed(0))

    assert all(torch.equal(before[name], one) for name, one in learner.network.state_dict().items())
    assert not torch.equal(judged, learner.critic.out.bias)


def test_a_gradient_that_is_not_finite_stops_the_run_before_it_spoils_the_weights() -> None:
    seats, learner = make_seats(), make_learner()
    experience = collect(seats, learner.network.eval(), 6, Results())
    with pytest.raises(TrainingError, match="not finite"):
        learner.learn(replace(experience, reward=experience.reward + torch.nan), 4, FULL, torch.Generator().manual_seed(0))

    assert all(torch.isfinite(one).all() for one in learner.network.state_dict().values())
    assert all(torch.isfinite(one).all() for one in learner.average.values())


def test_cloning_brings_the_learner_to_agree_with_the_script() -> None:
    settings = replace(SETTINGS, games=24, opponents={"self": 1.0}, clone_minibatch=128)
    seats, learner, generator = make_seats(settings), make_learner(settings), torch.Generator().manual_seed(0)
    teacher = Teacher("rush", seats)
    agreed = []
    for _ in range(12):
        lesson = collect_lesson(seats, teacher, learner.network.eval(), 6, 0.0, np.random.default_rng(0))
        agreed.append(learn_lesson(learner, lesson, seats.n_walkers, 5e-3, generator)["agreed"])

    assert agreed[-1] > 0.45 > 0.35 > agreed[0]


def test_what_was_scored_while_cloning_is_not_earned_again() -> None:
    settings = replace(SETTINGS, games=24, opponents={"rush": 1.0})
    seats = make_seats(settings)
    network = TeamNetwork(SMALL).eval()
    collect_lesson(seats, Teacher("fighter", seats), network, 30, 0.0, np.random.default_rng(0))
    before = seats.env.games.state.field[:, StateField.SCORE].copy()
    experience = collect(seats, network, 1, Results())
    after = seats.env.games.state.field[:, StateField.SCORE]

    assert before.any()
    goes_on = ~experience.has_ended[0].numpy()
    np.testing.assert_allclose(experience.gain[0].numpy()[goes_on], ((after - before) / 100)[goes_on], atol=1e-6)


def test_a_better_self_takes_the_place_of_the_best_only_through_the_gate() -> None:
    weights = {"w": torch.zeros(1)}
    pool = Pool(weights, gate_matches=20, gate_score=0.55)
    newer = {"w": torch.ones(1)}

    pool.note_best([1.0] * 19)
    assert not pool.try_gate(newer)  # too few
    pool.note_best([0.0] * 10)
    assert not pool.try_gate(newer)  # 11 of the last 20 would be enough: the first nine no longer count
    pool.note_best([1.0] * 12)
    assert pool.try_gate(newer)
    assert pool.best["w"] == 1
    assert not pool.try_gate(newer)  # matches against another count for nothing
    newer["w"][:] = 5
    assert pool.best["w"] == 1


def test_former_selves_that_win_are_met_more_often() -> None:
    pool = Pool({"w": torch.zeros(1)}, gate_matches=1, gate_score=0.0)
    for _ in range(3):
        pool.note_best([1.0])
        pool.try_gate({"w": torch.zeros(1)})
    pool.points = [0.1, 0.9, 0.9, 0.9]
    rng = np.random.default_rng(0)
    met = np.bincount([pool.draw_past(rng) for _ in range(500)], minlength=4)

    assert met[0] > 400
    assert (met > 0).all()


def rows_of(folder: Path) -> list[dict[str, str]]:
    with (folder / METRICS).open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def start_run(folder: RunFolder, budget: Budget, stop_after: int = 10**9) -> PpoRun:
    asked = iter(range(10**9))
    run = PpoRun(folder, SETTINGS, "clone:rush", budget, Processes(), lambda *_: None)
    run.train(lambda: next(asked) >= stop_after)
    return run


def test_a_run_goes_on_where_it_was_stopped(tmp_path: Path) -> None:
    folder = RunFolder(tmp_path / "run")
    folder.create({})
    first = start_run(folder, Budget(samples=700), stop_after=4)
    assert first.counts.samples < 500
    assert load_checkpoint(folder.path / START).manifest.training["start"] == "clone:rush"
    kept = first.learner.network.state_dict()
    folder.add_metrics({"step": first.counts.step + 1, "stage": "ppo"})  # of a rollout that a kill took away

    second = PpoRun(folder, SETTINGS, "clone:rush", Budget(samples=700), Processes(), lambda *_: None)
    assert all(torch.equal(kept[name], one) for name, one in second.learner.network.state_dict().items())
    assert second.train(lambda: False)

    assert second.counts.sittings == 2
    assert second.counts.cloned == first.counts.cloned
    assert [int(row["step"]) for row in rows_of(folder.path)] == list(range(1, second.counts.step + 1))
    manifest = load_checkpoint(folder.path / LAST).manifest
    assert manifest.ruleset_hash == PAPER.hash
    assert manifest.training["samples"] == second.counts.samples


def test_what_a_run_did_before_it_kept_anything_is_done_and_told_once(tmp_path: Path) -> None:
    folder = RunFolder(tmp_path / "run")
    folder.create({})
    for step in (1, 2):
        folder.add_metrics({"step": step, "stage": "clone"})  # of a sitting that was killed before it saved

    run = start_run(folder, Budget(samples=700), stop_after=2)

    assert [int(row["step"]) for row in rows_of(folder.path)] == list(range(1, run.counts.step + 1))


def test_other_rulesets_get_their_share_of_lessons_and_rollouts(tmp_path: Path) -> None:
    folder = RunFolder(tmp_path / "run")
    folder.create({})
    settings = replace(SETTINGS, also={"exp1": 0.5}, clone_samples=200)
    run = PpoRun(folder, settings, "clone:rush", Budget(samples=900), Processes(), lambda *_: None)
    run.train(lambda: False)

    rows = rows_of(folder.path)
    lessons = sum(row["stage"] == "clone" for row in rows)
    assert [row["rules"] for row in rows] == [("exp1", "paper")[step % 2] for step in range(len(rows))]
    assert 1 < lessons < len(rows) - 4
    assert load_checkpoint(folder.path / LAST).manifest.ruleset == "paper"
    assert "score_exp1" in rows[0]


def test_a_checkpoint_is_taught_by_another_teacher_under_each_ruleset(tmp_path: Path) -> None:
    folder = RunFolder(tmp_path / "run")
    folder.create({})
    start_run(folder, Budget(samples=100))
    file = str(folder.path / LAST)
    settings = replace(SETTINGS, also={"exp1": 0.5}, teachers={"paper": file, "exp1": "rush"})
    taught = RunFolder(tmp_path / "taught")
    taught.create({})
    run = PpoRun(taught, settings, file, Budget(samples=60), Processes(), lambda *_: None)
    run.train(lambda: False)

    assert {row["stage"] for row in rows_of(taught.path)} == {"clone"}
    assert {row["rules"] for row in rows_of(taught.path)} == {"paper", "exp1"}
    with pytest.raises(InputError, match="nobody for exp1"):
        PpoRun(
            RunFolder(tmp_path / "x"), replace(settings, teachers={"paper": file}), file, Budget(samples=1), Processes(), print
        )


def test_where_red_has_no_units_the_learner_meets_nobody() -> None:
    torch.manual_seed(0)
    exp1 = load_rules("exp1").with_({"tick_limit": 12})
    seats = LearnerSeats(BatchedEnv(exp1, 4, seed=1), Opponents(exp1, SETTINGS.opponents, 0, 4, TeamNetwork(SMALL)))
    results = Results()
    experience = collect(seats, TeamNetwork(SMALL), 30, results)

    assert seats.n_seats == 4
    assert list(results.points) == ["nobody"]
    assert (experience.reward >= 0).all()
    assert len(results.points["nobody"]) == int(experience.has_ended.sum()) >= 8


def test_a_damaged_state_and_a_taken_folder_are_refused(tmp_path: Path) -> None:
    folder = RunFolder(tmp_path)
    with pytest.raises(InputError, match="no run in"):
        folder.read_settings()
    folder.create({"settings": {}})
    with pytest.raises(InputError, match="--resume"):
        folder.create({})
    with (
        folder.hold(),
        pytest.raises(InputError, match=r"^another process is training in .*; wait until it has ended"),
        folder.hold(),
    ):
        pass
    with folder.hold():
        pass  # whoever held it has let it go
    (tmp_path / STATE).write_bytes(b"rubbish")
    with pytest.raises(InputError, match="damaged"):
        folder.load_state()


@pytest.mark.parametrize(
    "kept", ["[]", "3", "{}", '{"settings": []}', '{"settings": {}}', '{"settings": {"opponents": 3}, "start": "", "budget": {}}']
)
def test_settings_that_are_not_as_they_were_written_are_one_sentence(tmp_path: Path, kept: str) -> None:
    (tmp_path / SETTINGS_FILE).write_text(kept)

    with pytest.raises(InputError, match=r"not as (it was|they were) written"):
        read_config(RunFolder(tmp_path).read_settings())


def test_a_start_of_another_ruleset_or_shape_is_refused(tmp_path: Path) -> None:
    folder = RunFolder(tmp_path / "run")
    folder.create({})
    start_run(folder, Budget(samples=100))
    file = str(folder.path / LAST)
    for settings, reason in (
        (replace(SETTINGS, rules="gym-cap"), "ruleset paper"),
        (replace(SETTINGS, channels=16), "settings ask for"),
    ):
        with pytest.raises(InputError, match=reason):
            PpoRun(RunFolder(tmp_path / "other"), settings, file, Budget(samples=1), Processes(), lambda *_: None)


def test_settings_name_what_is_wrong() -> None:
    assert PpoSettings().with_(["also.exp1=0.25", "also.exp2=0.25"]).shares() == {"paper": 0.5, "exp1": 0.25, "exp2": 0.25}
    for also in ("also.exp1=1", "also.paper=0.1", "also.exp1=-0.1", "also.exp1=nan"):
        with pytest.raises(InputError, match="other rulesets"):
            PpoSettings().with_([also])
    with pytest.raises(InputError, match="teachers names exp3; the run's rulesets are paper"):
        PpoSettings().with_(["teachers.exp3='rush'"])
    with pytest.raises(InputError, match="fighters by ruleset"):
        PpoSettings().with_(["teachers='rush'"])
    for shares in ("also=0.1", "opponents=1", 'opponents.rush="high"'):
        with pytest.raises(InputError, match="shares by name"):
            PpoSettings().with_([shares])
    assert PpoSettings().with_(["games=64", "opponents.rush=0.5", "opponents.roomba=0"]).opponents["rush"] == 0.5
    assert "roomba" not in PpoSettings().with_(["opponents.roomba=0"]).opponents
    with pytest.raises(UnknownNameError, match="gamma"):
        PpoSettings().with_(["gama=0.9"])
    with pytest.raises(InputError, match="games"):
        PpoSettings().with_(["games=0"])
    with pytest.raises(InputError, match="number"):
        from_dict({"gamma": "much"})


RANKS = """
import sys
import torch
sys.path.append({folder!r})
from test_training import FULL, PAPER, SETTINGS, SMALL, Results, collect, make_learner, make_seats, replace
from tournaments.cli import main
from policies.training.parallel import join_processes

processes = join_processes()
settings = replace(SETTINGS, opponents={{"rush": 1.0}})
def gradients(processes, first, n):
    learner = make_learner(settings)
    learner.processes, learner.step = processes, lambda: processes.average_gradients(learner.parameters) or {{}}
    experience = collect(make_seats(settings, first_row=first, n_rows=n), learner.network.eval(), 6, Results())
    learner.learn(experience, 4, FULL, torch.Generator().manual_seed(0))
    return torch.cat([one.grad.flatten() for one in learner.parameters if one.grad is not None])

settings = replace(settings, minibatch=10**9, epochs=1)
together = gradients(processes, *processes.share(settings.games))
if processes.is_first:
    alone = gradients(type(processes)(), 0, settings.games)
    print("difference", float((together - alone).norm() / alone.norm()), "norm", float(alone.norm()))
sys.argv[0] = "arena"
main()  # the same processes train, and part at the end
"""


def test_two_processes_have_the_gradient_of_one_and_train_one_network(tmp_path: Path) -> None:
    script = tmp_path / "ranks.py"
    script.write_text(RANKS.format(folder=str(Path(__file__).parent)))
    command = [
        sys.executable, "-m", "torch.distributed.run", "--nproc-per-node", "2", "--", str(script),
        "train", "--start", "clone:rush", "--samples", "300",
        "--out", str(tmp_path / "run"), "--set", "games=8", "--set", "horizon=6", "--set", "minibatch=24", "--set", "channels=8",
        "--set", "blocks=1", "--set", "clone_samples=60", "--set", "critic_warmup=1",
        *(f"--set=opponents.{name}=0" for name in ("role_team", "roomba", "fighter")),
    ]  # fmt: skip
    environment = {**os.environ, "OMP_NUM_THREADS": "1", **KEEP}  # without these variables `train` starts anew
    done = subprocess.run(command, capture_output=True, text=True, timeout=300, check=False, env=environment)

    assert done.returncode == 0, done.stderr
    told = done.stdout.split()
    assert float(told[told.index("norm") + 1]) > 1e-3
    # Parts differ in how many units live, by which each is weighted, and in the order of sums in bf16.
    assert float(told[told.index("difference") + 1]) < 0.1
    assert done.stdout.count("trained") == 1
    kept = json.loads((tmp_path / "run" / "settings.json").read_text())
    assert kept["settings"]["games"] == 8
    assert {row["stage"] for row in rows_of(tmp_path / "run")} == {"clone", "ppo"}


def test_colours_are_learned_from_alike() -> None:
    """Red's seats of self-play see themselves as own: as many own units on foot as blue's."""
    seats = make_seats(replace(SETTINGS, opponents={"self": 1.0}))
    experience = collect(seats, TeamNetwork(SMALL).eval(), 1, Results())

    assert experience.planes.shape[1] == 16
    assert seats.env.games.n_units[Team.RED] == seats.n_units
    assert (experience.alive == 1).all()
