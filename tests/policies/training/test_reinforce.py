"""The paper's method: returns, replay, gradients, rounds of matches, and runs of it."""

import csv
import errno
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from arena.envs.batched import BatchedEnv, StepResult
from arena.errors import ArenaError, InputError, UnknownNameError
from arena.game.ruleset import Ruleset
from arena.game.ruleset import load as load_rules
from arena.game.types import Action, Code, Team
from policies.networks import checkpoint
from policies.networks.checkpoint import describe, load_checkpoint, save_checkpoint
from policies.networks.learned import LearnedUnits
from policies.networks.models import PaperTeam
from policies.registry import load
from policies.training.budget import Budget
from policies.training.folder import LAST, METRICS, RunFolder
from policies.training.gradients import TrainingError
from policies.training.parallel import Processes
from policies.training.reinforce import Reinforcer, credit, standardise
from policies.training.reinforce_run import ReinforceRun
from policies.training.reinforce_settings import ReinforceSettings, from_dict
from policies.training.replay import Replay, Samples
from policies.training.trajectories import Outcome, RoundPlayer

torch.set_num_threads(1)
EXP1 = load_rules("exp1")
SETTINGS = ReinforceSettings(window=7, update_every=4, batch=60, buffer=600, bf16=False)


@pytest.fixture
def tiny(tmp_path: Path) -> str:
    """A small board without enemies, as a file of rules."""
    file = tmp_path / "tiny.toml"
    file.write_text('base = "exp1"\nside = 8\ntick_limit = 20\n\n[units.ugv]\nblue = 2\n')
    return str(file)


def samples(n: int, update: int = 0, seed: int = 0) -> Samples:
    rng = torch.Generator().manual_seed(seed)
    return Samples(
        views=torch.randint(-1, 9, (n, 7, 7), generator=rng, dtype=torch.int8), unit=torch.arange(n) % 2,
        action=torch.randint(0, 5, (n,), generator=rng), logp=torch.full((n,), -1.6), tick=torch.arange(n) % 5,
        returned=torch.randn(n, generator=rng), update=torch.full((n,), update),
    )  # fmt: skip


def test_table_3_is_the_default() -> None:
    usual = ReinforceSettings()

    assert (usual.gamma, usual.rate, usual.update_every, usual.buffer, usual.batch) == (0.98, 1e-4, 10, 50_000, 2_000)
    assert EXP1.tick_limit == 100


@pytest.mark.parametrize("reward", ["terminal", "stream", "differences"])
def test_returns_are_the_sum_of_algorithm_1_for_every_reading_of_the_reward(reward: str) -> None:
    stream = np.array([[0.0, -10.0], [-10.0, -10.0], [-10.0, 20.0], [100.0, 7.0]])
    length = np.array([4, 3])  # what follows the end of the second match must not count
    gamma = 0.9

    returned = credit(stream, length, reward, gamma)

    for match in range(2):
        last, scores = int(length[match]), stream[:, match]
        rewards = {
            "terminal": [0.0] * (last - 1) + [scores[last - 1]],
            "stream": list(scores[:last]),
            "differences": [scores[k] - (scores[k - 1] if k else 0.0) for k in range(last)],
        }[reward]
        for t in range(4):
            # R_k is what action k - 1 led to: counted from 0, G sums gamma^(k - t) of rewards[k] from k = t on.
            wanted = sum(gamma ** (k - t) * rewards[k] for k in range(t, last))
            assert returned[t, match] == pytest.approx(wanted)


def test_a_match_that_runs_out_pays_extra_at_its_last_tick() -> None:
    stream, length = np.array([[0.0, 0.0], [0.0, 100.0], [-10.0, 5.0]]), np.array([3, 2])

    plain, stalled = (credit(stream, length, "differences", 0.5, extra) for extra in (0.0, np.array([-30.0, 0.0])))

    np.testing.assert_allclose(stalled - plain, [[-7.5, 0], [-15, 0], [-30, 0]])


def test_standardised_returns_have_mean_0_and_deviation_1_in_each_trajectory() -> None:
    returned, trajectory = np.array([1.0, 5.0, 3.0, 5.0, 10.0, 5.0]), np.array([0, 4, 0, 4, 2, 4])

    np.testing.assert_allclose(standardise(returned, trajectory), [-1, 0, 1, 0, 0, 0])


def test_the_replay_forgets_the_oldest_and_draws_from_all_alike() -> None:
    replay = Replay(100)
    for update in range(4):
        replay.add(samples(40, update))

    drawn = replay.draw(20_000, np.random.default_rng(0))
    found = np.bincount(drawn.update.numpy(), minlength=4) / 20_000

    assert replay.n == 100
    np.testing.assert_allclose(found, [0, 0.2, 0.4, 0.4], atol=0.02)


def test_more_samples_than_the_replay_holds_leave_the_last() -> None:
    replay = Replay(10)
    new = samples(25)
    replay.add(new)

    assert set(replay.draw(500, np.random.default_rng(0)).returned.tolist()) == set(new.returned[-10:].tolist())


def test_an_empty_replay_says_so() -> None:
    with pytest.raises(ValueError, match="empty"):
        Replay(3).draw(1, np.random.default_rng(0))


def objective(network: PaperTeam, batch: Samples, settings: ReinforceSettings) -> torch.Tensor:
    """Return what the paper's ascent climbs, sample by sample."""
    returned = batch.returned - batch.returned.mean() if settings.baseline == "mean" else batch.returned
    returned = returned / returned.std() if settings.normalise else returned
    total = torch.zeros(())
    for index in range(len(batch.unit)):
        logits = network(batch.views[index : index + 1], batch.unit[index : index + 1])[0]
        logp = logits.log_softmax(-1)[batch.action[index]]
        weight = returned[index] * (settings.gamma ** int(batch.tick[index]) if settings.discount_steps else 1.0)
        if settings.importance:
            weight = weight * min(float((logp.detach() - batch.logp[index]).exp()), settings.importance)
        total = total + weight * logp
    return total


@pytest.mark.parametrize(
    "changes",
    [
        {}, {"discount_steps": False}, {"importance": 1.01}, {"baseline": "mean"}, {"normalise": True}, {"policies": "each"},
    ],
)  # fmt: skip
def test_the_gradient_is_that_of_algorithm_1(changes: dict[str, object]) -> None:
    settings = replace(SETTINGS, **changes)
    torch.manual_seed(0)
    network = PaperTeam(7, settings.agents(2))
    learner, batch = Reinforcer(network, settings, Processes()), samples(30)
    learner.backward(batch)
    found = [one.grad.clone() for one in network.parameters()]
    network.zero_grad()

    (-objective(network, batch, settings) / 30).backward()

    for mine, one in zip(found, network.parameters(), strict=True):
        torch.testing.assert_close(mine, one.grad, atol=1e-5, rtol=1e-3)


def test_plain_ascent_takes_the_step_of_algorithm_1_for_every_sample() -> None:
    settings = replace(SETTINGS, optimiser="ascent", rate=1e-3, batch=30)
    torch.manual_seed(0)
    network = PaperTeam(7)
    before = [one.detach().clone() for one in network.parameters()]
    learner = Reinforcer(network, settings, Processes())
    learner.replay.add(samples(600))
    learner.update(0, np.random.default_rng(0))
    drawn = learner.replay.draw(30, np.random.default_rng(0))
    after = [one.detach().clone() for one in network.parameters()]
    with torch.no_grad():
        for one, old in zip(network.parameters(), before, strict=True):
            one.copy_(old)
    network.zero_grad()

    objective(network, drawn, settings).backward()

    for one, old, new in zip(network.parameters(), before, after, strict=True):
        torch.testing.assert_close(new - old, 1e-3 * one.grad, atol=1e-6, rtol=1e-3)


def test_what_pays_becomes_likelier() -> None:
    settings = replace(SETTINGS, rate=1e-3, baseline="mean", batch=200)
    torch.manual_seed(0)
    learner, views = Reinforcer(PaperTeam(7), settings, Processes()), samples(600)
    learner.replay.add(views._replace(returned=(views.action == 3).float(), tick=torch.zeros(600, dtype=torch.int64)))
    rng = np.random.default_rng(0)

    def chance() -> float:
        with torch.no_grad():
            return float(learner.network(views.views, views.unit).softmax(-1)[:, 3].mean())

    before = chance()
    for update in range(20):
        learner.update(update, rng)

    assert chance() > before + 0.2


@pytest.mark.parametrize(("returned", "reason"), [(torch.nan, "not finite"), (1e12, "exploded")])
def test_a_gradient_that_is_no_longer_sound_stops_before_the_step(returned: float, reason: str) -> None:
    learner = Reinforcer(PaperTeam(7), SETTINGS, Processes())
    learner.replay.add(samples(600)._replace(returned=torch.full((600,), returned)))
    before = {name: one.clone() for name, one in learner.network.state_dict().items()}
    with pytest.raises(TrainingError, match=reason):
        learner.update(0, np.random.default_rng(0))

    assert all(torch.equal(before[name], one) for name, one in learner.network.state_dict().items())


def stage(ruleset: Ruleset, n_rows: int, first_row: int = 0, opponent: str = "") -> RoundPlayer:
    env = BatchedEnv(ruleset, n_rows, seed=1, first_row=first_row)
    red = load(opponent)(ruleset, Team.RED, n_rows) if opponent else None
    return RoundPlayer(env, red, SETTINGS)


def test_a_round_is_the_same_in_one_process_and_in_parts(tiny: str) -> None:
    ruleset = load_rules(tiny)
    torch.manual_seed(0)
    network = PaperTeam(7)
    whole, outcome = stage(ruleset, 6).play_round(network, 3)
    parts = [stage(ruleset, 3, first_row=first).play_round(network, 3) for first in (0, 3)]

    np.testing.assert_array_equal(outcome.score, np.concatenate([one.score for _, one in parts]))
    np.testing.assert_array_equal(outcome.ticks, np.concatenate([one.ticks for _, one in parts]))
    assert len(whole.unit) == sum(len(one.unit) for one, _ in parts)
    assert whole.returned.sum() == pytest.approx(float(sum(one.returned.sum() for one, _ in parts)), rel=1e-4)


def test_a_round_is_each_row_s_match_from_its_start_to_its_end(tiny: str) -> None:
    ruleset = load_rules(tiny)
    torch.manual_seed(0)
    played, outcome = stage(ruleset, 12).play_round(PaperTeam(7), 0)
    again, _ = stage(ruleset, 12).play_round(PaperTeam(7), 1)

    assert outcome.is_captured.any()
    assert not outcome.is_captured.all()
    assert (outcome.score[outcome.is_captured] == 100).all()
    assert (outcome.ticks[~outcome.is_captured] == ruleset.tick_limit).all()
    np.testing.assert_array_equal(outcome.is_won, outcome.is_captured)
    assert len(played.unit) == 2 * outcome.ticks.sum()  # both units live to the end: there is nobody to fall to
    np.testing.assert_array_equal(np.bincount(played.tick.numpy()), [2 * (outcome.ticks > tick).sum() for tick in range(20)])
    assert not torch.equal(played.views[:24], again.views[:24])  # other maps


def test_a_round_pays_for_what_ran_out_and_standardises_each_unit_s_returns(tiny: str) -> None:
    def play(**changes: object) -> tuple[Samples, Outcome]:
        torch.manual_seed(0)
        return RoundPlayer(BatchedEnv(load_rules(tiny), 12, seed=1), None, replace(SETTINGS, **changes)).play_round(
            PaperTeam(7), 0
        )

    plain, outcome = play()
    stalled, _ = play(stall=-30)
    standard, _ = play(standardise="trajectory")

    last = (plain.tick == 19) & (plain.returned == 0)
    assert last.any()
    assert (stalled.returned[last] == -30).all()
    assert torch.equal((stalled.returned - plain.returned) != 0, plain.returned == 0)  # what captured pays as before
    moved = standard.returned[plain.returned != 0]
    assert moved.sum() == pytest.approx(0, abs=1e-3)
    assert moved.square().sum() == pytest.approx(len(moved), rel=1e-4)
    assert len(moved) == 2 * outcome.ticks[outcome.is_captured].sum()
    assert not standard.returned[plain.returned == 0].any()


def test_steps_off_the_board_and_into_obstacles_are_counted(tiny: str) -> None:
    ruleset = load_rules(tiny)
    player = stage(ruleset, 12)
    env, side, step = player.env, ruleset.side, player.env.step
    n_steps, n_blocked, is_playing = np.zeros(12), np.zeros(12), np.ones(12, bool)

    def watch(orders: dict[Team, np.ndarray]) -> StepResult:
        for row in np.flatnonzero(is_playing):
            for cell, order in zip(env.games.state.cell[row, :2].tolist(), orders[Team.BLUE][row], strict=True):
                down, right = {Action.NORTH: (-1, 0), Action.SOUTH: (1, 0), Action.EAST: (0, 1), Action.WEST: (0, -1)}.get(
                    Action(order), (0, 0)
                )
                there = cell // side + down, cell % side + right
                is_free = min(there) >= 0 and max(there) < side
                n_steps[row] += order != Action.STAY
                n_blocked[row] += not is_free or env.games.state.ground[row, there[0] * side + there[1]] == Code.OBSTACLE
        turn = step(orders)
        is_playing[turn.has_ended] = False
        return turn

    env.step = watch  # type: ignore[method-assign]
    _, outcome = player.play_round(None, 0)

    assert 0 < n_blocked.sum() < n_steps.sum()
    np.testing.assert_allclose(outcome.blocked, n_blocked / n_steps)


def test_units_act_at_random_where_no_network_plays(tiny: str) -> None:
    played, _ = stage(load_rules(tiny), 12).play_round(None, 0)

    np.testing.assert_allclose(played.logp, np.log(0.2), rtol=1e-6)
    np.testing.assert_allclose(np.bincount(played.action, minlength=5) / len(played.action), 0.2, atol=0.06)


def test_the_fallen_decide_no_more_and_share_the_score_of_the_end() -> None:
    ruleset = load_rules("exp2").with_({"side": 10, "tick_limit": 40})
    torch.manual_seed(0)
    played, outcome = stage(ruleset, 6, opponent="rush").play_round(PaperTeam(7), 0)

    assert len(played.unit) < 4 * outcome.ticks.sum()
    assert (outcome.score < 0).any()
    assert set(np.round(played.returned.numpy() * 0.98 ** played.tick.numpy(), 3)) == {
        round(float(score) * 0.98 ** (int(ticks) - 1), 3)
        for score, ticks in zip(outcome.score.astype(np.float32), outcome.ticks, strict=True)
    }


def run_of(folder: Path, settings: ReinforceSettings, episodes: int, start: str = "") -> ReinforceRun:
    return ReinforceRun(RunFolder(folder), settings, start, Budget(episodes=episodes), Processes(), lambda *_: None)


def rows_of(folder: Path) -> list[dict[str, str]]:
    with (folder / METRICS).open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def test_a_run_goes_on_where_it_was_stopped_and_can_be_played(tmp_path: Path, tiny: str) -> None:
    settings = replace(SETTINGS, rules=tiny)
    folder = tmp_path / "run"
    RunFolder(folder).create({})
    asked = iter(range(100))
    first = run_of(folder, settings, 24)
    assert not first.train(lambda: next(asked) >= 2)
    assert first.counts.episodes == 8
    RunFolder(folder).add_metrics({"step": 3})  # of a round that a kill took away

    second = run_of(folder, settings, 24)
    for name, one in first.learner.network.state_dict().items():
        assert torch.equal(second.learner.network.state_dict()[name], one)
    assert second.train(lambda: False)

    assert [int(row["step"]) for row in rows_of(folder)] == [1, 2, 3, 4, 5, 6]
    assert {row["stage"] for row in rows_of(folder)} == {"tiny"}
    manifest = load_checkpoint(folder / LAST).manifest
    assert manifest.training["progress"] == 1
    assert manifest.training["method"] == "reinforce"
    fighter = load(str(folder / LAST))(EXP1, Team.BLUE, 3)
    orders = np.full((3, 4), -1, np.int8)
    fighter.act(BatchedEnv(EXP1, 3, seed=1).observe()[Team.BLUE], orders)
    assert ((orders >= 0) & (orders < 5)).all()


def test_no_update_comes_before_the_end_of_the_warm_up(tmp_path: Path, tiny: str) -> None:
    RunFolder(tmp_path / "run").create({})
    run = run_of(tmp_path / "run", replace(SETTINGS, rules=tiny, warmup=8), 16)
    before = {name: one.clone() for name, one in run.learner.network.state_dict().items()}
    asked = iter(range(100))
    run.train(lambda: next(asked) >= 2)

    assert run.counts.episodes == 8
    assert run.learner.replay.n > 0
    assert all(torch.equal(before[name], one) for name, one in run.learner.network.state_dict().items())

    run = run_of(tmp_path / "run", replace(SETTINGS, rules=tiny, warmup=8), 16)
    assert run.train(lambda: False)
    assert [row["norm"] == "nan" for row in rows_of(tmp_path / "run")] == [True, True, False, False]
    assert not all(torch.equal(before[name], one) for name, one in run.learner.network.state_dict().items())


@pytest.mark.parametrize("settings", [SETTINGS, replace(SETTINGS, window=9, codes="signed", edge="obstacle")])
def test_a_seat_shows_a_network_what_it_was_trained_on(tmp_path: Path, settings: ReinforceSettings) -> None:
    ruleset = load_rules("exp4").with_({"side": 10, "tick_limit": 3})
    saved = tmp_path / "one.safetensors"
    torch.manual_seed(0)
    network = PaperTeam(settings.window, 1, settings.planes, settings.edge_code)
    save_checkpoint(saved, network.state_dict(), describe(network, ruleset, {}))
    player = RoundPlayer(BatchedEnv(ruleset, 2, seed=1), load("random")(ruleset, Team.RED, 2), settings)
    trained, _ = player.play_round(network, 0)
    played: list[torch.Tensor] = []

    seat = load(str(saved))(ruleset, Team.BLUE, 2)
    assert isinstance(seat, LearnedUnits)
    seat._fast.members[0].first.register_forward_pre_hook(lambda _, given: played.append(given[0]))
    env, orders = BatchedEnv(ruleset, 2, seed=1), np.zeros((2, 6), np.int8)
    env.skip_to(np.zeros(2, np.int64))
    seat.act(env.observe()[Team.BLUE], orders)
    learned: list[torch.Tensor] = []
    network.members[0].first.register_forward_pre_hook(lambda _, given: learned.append(given[0]))
    Reinforcer(network, settings, Processes()).backward(Samples(*(one[:12] for one in trained)))

    assert torch.equal(played[0], learned[0])
    assert (trained.views[:12] == settings.edge_code).any()


@pytest.mark.parametrize("policies", [1, 3])
def test_an_opponent_that_is_the_learner_itself_plays_as_it_would_in_a_seat_of_its_own(policies: int) -> None:
    ruleset = load_rules("exp4").with_({"side": 14, "tick_limit": 40})
    torch.manual_seed(0)
    network = PaperTeam(7, policies)
    env = BatchedEnv(ruleset, 6, seed=1)
    seated, outcome = RoundPlayer(env, LearnedUnits(ruleset, Team.RED, 6, network=network), SETTINGS).play_round(network, 2)
    alone, same = stage(ruleset, 6).play_round(network, 2)

    assert len(alone.unit) == len(seated.unit)
    assert torch.equal(alone.action, seated.action)
    np.testing.assert_array_equal(same.score, outcome.score)
    assert (outcome.score != 0).any()


def test_a_nan_keeps_the_last_good_checkpoint(tmp_path: Path, tiny: str) -> None:
    folder = tmp_path / "run"
    RunFolder(folder).create({})
    run_of(folder, replace(SETTINGS, rules=tiny), 8).train(lambda: False)
    before = (folder / LAST).read_bytes()
    run = run_of(folder, replace(SETTINGS, rules=tiny), 80)
    with torch.no_grad():
        run.learner.network.members[0].out.bias[0] = torch.nan
    with pytest.raises(TrainingError, match="last checkpoint is good"):
        run.train(lambda: False)

    assert (folder / LAST).read_bytes() == before
    load_checkpoint(folder / LAST)


def test_a_full_disk_ends_a_run_with_one_sentence_and_keeps_what_was_there(
    tmp_path: Path, tiny: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = tmp_path / "run"
    RunFolder(folder).create({})
    run_of(folder, replace(SETTINGS, rules=tiny), 4).train(lambda: False)
    kept = {file.name: file.read_bytes() for file in folder.iterdir() if file.suffix in (".pt", ".safetensors")}

    def full(_: int) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(checkpoint.os, "fsync", full)
    with pytest.raises(ArenaError, match="No space left on device") as refusal:
        run_of(folder, replace(SETTINGS, rules=tiny), 8).train(lambda: False)

    assert "\n" not in str(refusal.value)
    assert {name: (folder / name).read_bytes() for name in kept} == kept
    assert not [file for file in folder.iterdir() if file.name.startswith(".")]


def test_a_policy_for_each_unit_is_handed_on_to_a_larger_team(tmp_path: Path) -> None:
    first = tmp_path / "exp3"
    RunFolder(first).create({})
    settings = replace(SETTINGS, rules="exp3", policies="each", opponent="random", update_every=1, batch=10)
    run_of(first, settings, 1).train(lambda: False)

    larger = run_of(tmp_path / "exp4", replace(settings, rules="exp4"), 1, start=str(first / LAST)).learner.network
    before = load_checkpoint(first / LAST).network

    assert (before.agents, larger.agents) == (4, 6)
    for index in range(6):
        assert torch.equal(larger.members[index].out.bias, before.members[index % 4].out.bias)


def test_a_policy_of_other_planes_is_no_start(tmp_path: Path) -> None:
    first = tmp_path / "raw"
    RunFolder(first).create({})
    settings = replace(SETTINGS, rules="exp1", update_every=1, batch=10)
    run_of(first, settings, 1).train(lambda: False)
    with pytest.raises(InputError, match="planes is 1, and the settings ask for 10"):
        run_of(tmp_path / "planes", replace(settings, codes="planes"), 1, start=str(first / LAST))
    with pytest.raises(InputError, match="edge is hidden, and the settings ask for obstacle"):
        run_of(tmp_path / "edge", replace(settings, edge="obstacle"), 1, start=str(first / LAST))


@pytest.mark.parametrize(
    ("assignment", "reason"),
    [
        ("reward=final", "must be one of terminal"), ("gamma=0", "above 0"), ("batch=1", "at least 2"),
        ("normalise=1", "true or"), ("codes=signs", "raw, planes, signed"), ("edge=wall", "hidden, obstacle"),
        ("window=65", "at most 64"), ("stall=-101", "from -100 to 100"),
        ("standardise=batch", "none, trajectory"), ("warmup=-1", "at least 0"), ("importance=-1", "0 or more"),
    ],
)  # fmt: skip
def test_settings_name_what_is_wrong(assignment: str, reason: str) -> None:
    with pytest.raises(InputError, match=reason):
        ReinforceSettings().with_([assignment])
    with pytest.raises(UnknownNameError, match="gamma"):
        ReinforceSettings().with_(["gama=0.9"])


def test_settings_come_back_from_a_folder_as_they_were() -> None:
    settings = ReinforceSettings().with_(["reward=stream", "normalise=true", "importance=2", "stall=-30", "edge=obstacle"])

    assert (settings.reward, settings.normalise, settings.importance) == ("stream", True, 2.0)
    assert (settings.stall, settings.edge) == (-30.0, "obstacle")
    assert from_dict(json.loads(json.dumps({name: getattr(settings, name) for name in settings.__slots__}))) == settings
