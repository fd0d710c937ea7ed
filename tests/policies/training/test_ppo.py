"""What a step of PPO is made of: gradients that are cut apart, and a pull to the teacher; and whom it meets."""

import csv
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from threading import Semaphore
from typing import Any

import pytest
import torch
from small import FULL, PAPER, SETTINGS, advantageous, make_learner, make_seats
from torch import nn

from arena.errors import ArenaError, InputError
from arena.game.types import Action
from policies.networks.checkpoint import describe, load_checkpoint, save_checkpoint
from policies.networks.models import PaperTeam, TeamNetwork, TeamShape
from policies.training import opponents, ppo_run
from policies.training.budget import Budget
from policies.training.folder import METRICS, START, RunFolder
from policies.training.methods import RunConfig, make_config, make_run
from policies.training.opponents import prioritise
from policies.training.parallel import Processes
from policies.training.ppo import MOST_NORM, Learner, schedule
from policies.training.ppo_run import PpoRun
from policies.training.ppo_settings import PpoSettings
from policies.training.reinforce_settings import ReinforceSettings
from policies.training.rollout import Results, collect
from policies.training.start import read_start, read_student


def norm_of(network: nn.Module) -> float:
    return float(torch.stack([one.grad.norm() for one in network.parameters() if one.grad is not None]).norm())


def test_what_the_critic_gets_wrong_takes_nothing_from_the_actors_step() -> None:
    learner = make_learner()
    for network, norm in ((learner.network, 0.8 * MOST_NORM), (learner.critic, 60.0)):
        for one in network.parameters():
            one.grad = torch.ones_like(one)
        by = norm / norm_of(network)
        for one in network.parameters():
            one.grad *= by

    found = learner.step()

    assert norm_of(learner.network) == pytest.approx(0.8 * MOST_NORM, rel=1e-3)
    assert norm_of(learner.critic) == pytest.approx(MOST_NORM, rel=1e-3)
    assert found == {"actor_norm": pytest.approx(0.8 * MOST_NORM, rel=1e-3), "critic_norm": pytest.approx(60.0, rel=1e-3)}


def learn_to_go_east(
    teacher_kl: float, n_rollouts: int = 8, *, has_teacher: bool = True
) -> tuple[Learner, list[float], dict[str, float]]:
    """Let a policy that was cloned meet a world in which going east pays; return it, its share of that, and the last metrics."""
    seats, generator = make_seats(), torch.Generator().manual_seed(0)
    learner = make_learner(replace(SETTINGS, target_kl=10.0, minibatch=12))
    if has_teacher:
        learner.stay_near(learner.network.state_dict())
    shares, metrics = [], {}
    for _ in range(n_rollouts):
        experience = collect(seats, learner.network.eval(), 6, Results())
        chosen = experience.actions[(experience.alive > 0) & (experience.legal[..., Action.EAST] > 0)]
        shares.append(float((chosen == Action.EAST).float().mean()))
        now = replace(FULL, rate=5e-3, teacher_kl=teacher_kl)
        metrics = learner.learn(advantageous(experience, Action.EAST), seats.n_walkers, now, generator)
    return learner, shares, metrics


def test_near_its_teacher_a_policy_stays_as_it_was_cloned() -> None:
    _, free, _ = learn_to_go_east(0.0)
    _, held, metrics = learn_to_go_east(1e3)

    assert free[-1] > free[0] + 0.2
    assert abs(held[-1] - held[0]) < 0.1
    assert 0 <= metrics["teacher_kl"] < 0.05


def test_a_teacher_that_counts_for_nothing_changes_nothing() -> None:
    with_teacher, _, metrics = learn_to_go_east(0.0, 2)
    without, _, _ = learn_to_go_east(0.0, 2, has_teacher=False)

    assert "teacher_kl" not in metrics
    for name, one in without.network.state_dict().items():
        assert torch.equal(one, with_teacher.network.state_dict()[name])


def test_the_weight_of_the_teacher_falls_to_nothing_over_its_share_of_the_run() -> None:
    settings = PpoSettings(teacher_kl=0.4, teacher_share=0.5)

    weights = [schedule(settings, progress, 0).teacher_kl for progress in (0.0, 0.25, 0.5, 0.9)]

    assert weights == pytest.approx([0.4, 0.2, 0.0, 0.0])
    assert schedule(PpoSettings(), 0.0, 0).teacher_kl == 0


def test_the_weight_of_the_entropy_falls_to_what_is_to_be_left_of_it() -> None:
    def weights(left: float) -> list[float]:
        return [schedule(PpoSettings(entropy=0.02, entropy_left=left), done, 0).entropy for done in (0.0, 0.5, 0.95, 1.0)]

    assert weights(0.1) == pytest.approx([0.02, 0.01, 0.002, 0.002])
    assert weights(0.0) == pytest.approx([0.02, 0.01, 0.001, 0.0])
    assert weights(1.0) == pytest.approx([0.02] * 4)


@pytest.mark.parametrize(
    ("setting", "wanted"),
    [
        ("teacher_kl=-1", "0 or more"), ("teacher_share=0", "above 0 and at most 1"),
        ("entropy_left=2", "from 0 to 1"), ("blocks=0", "at least 1"),
        ("average=nan", "at least 0 and below 1"), ("average=1.0", "at least 0 and below 1"), ("rate=nan", "above 0"),
        ("clone_rate=-1", "above 0"), ("clip=-1", "above 0"), ("seed=-1", "at least 0"), ("seed=100000000000000", "at most 4"),
        ("gate_matches=10000000000000", "at most 1,000,000"), ("entropy=inf", "0 or more"),
        ("opponents.rush=nan", "a share, which is a number from 0 on"),
    ],
)  # fmt: skip
def test_a_number_that_cannot_be_is_refused(setting: str, wanted: str) -> None:
    name = setting.partition("=")[0]
    with pytest.raises(InputError, match=f"the setting {name} is .*; it must be {wanted}"):
        PpoSettings().with_([setting])


@pytest.mark.parametrize("method", ["ppo", "reinforce"])
def test_a_seed_that_no_generator_takes_is_refused(method: str) -> None:
    with pytest.raises(InputError, match="the setting seed is 1"):
        make_config(method, "", Budget(), rules=None, seed=10**20, assignments=[])


@pytest.mark.parametrize("minutes", [float("nan"), float("inf"), 0.0])
def test_minutes_that_are_no_time_are_refused(minutes: float) -> None:
    with pytest.raises(InputError, match="it must be above 0 and finite"):
        Budget(minutes=minutes)


@pytest.mark.parametrize(
    ("start", "settings"),
    [
        ("", replace(SETTINGS, opponents={"rsuh": 1.0})),
        ("clone:rsuh", SETTINGS),
        ("", ReinforceSettings(opponent="rsuh")),
    ],
)
def test_who_is_not_there_is_refused_before_the_run_has_a_folder(
    tmp_path: Path, start: str, settings: PpoSettings | ReinforceSettings
) -> None:
    config = RunConfig(method="", start=start, budget=Budget(samples=1), settings=settings)

    with pytest.raises(ArenaError, match="rsuh"):
        make_run(config, RunFolder(tmp_path / "run"), Processes(), lambda *_: None, "cpu")


def test_where_red_has_no_units_the_metrics_tell_how_the_learner_fares_alone(tmp_path: Path) -> None:
    folder = RunFolder(tmp_path / "run")
    folder.create({})
    settings = replace(SETTINGS, rules="exp1", opponents={"rush": 1.0}, horizon=120, minibatch=512)
    PpoRun(folder, settings, "", Budget(samples=900), Processes(), lambda *_: None).train(lambda: False)

    with (folder.path / METRICS).open(encoding="utf-8", newline="") as file:
        last = list(csv.DictReader(file))[-1]
    assert "score_rush" not in last
    assert "newest" not in last
    assert 0.5 <= float(last["score_nobody"]) <= 1
    with pytest.raises(InputError, match="ruleset exp1 gives red no units, so nobody is met"):
        make_config("ppo", "", Budget(), rules="exp1", seed=1, assignments=[], against="rush")


def test_cloning_has_ended_for_good_once_anything_says_so(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A run that is killed right after the row of its last lesson goes on with what that lesson ended with."""
    folder = RunFolder(tmp_path / "run")
    folder.create({})

    def make() -> PpoRun:
        return PpoRun(folder, replace(SETTINGS, teacher_kl=0.1), "clone:rush", Budget(samples=400), Processes(), lambda *_: None)

    killed = make()
    note = killed._note

    def note_and_die(*what: Any) -> None:
        note(*what)
        if killed.counts.cloned >= SETTINGS.clone_samples:
            killed.save()
            raise KeyboardInterrupt

    monkeypatch.setattr(killed, "_note", note_and_die)
    with pytest.raises(KeyboardInterrupt):
        killed.train(lambda: False)
    second = make()

    started = load_checkpoint(folder.path / START).network.state_dict()
    assert all(torch.equal(tensor, second.pool.start[name]) for name, tensor in started.items())


def test_a_step_is_of_as_many_samples_as_the_settings_say() -> None:
    parts = list(make_learner().minibatches(62, 24, torch.Generator()))

    assert [len(part) for part in parts] == [21, 21, 20]
    assert len(list(make_learner().minibatches(2, 1, torch.Generator()))) == 2


def test_who_starts_from_nothing_has_no_teacher(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="teacher_kl"):
        PpoRun(RunFolder(tmp_path), replace(SETTINGS, teacher_kl=0.1), "", Budget(samples=1), Processes(), lambda *_: None)


def test_a_run_has_a_critic_of_the_size_that_its_settings_say(tmp_path: Path) -> None:
    settings = replace(SETTINGS, critic_channels=4, critic_blocks=0)

    run = PpoRun(RunFolder(tmp_path), settings, "", Budget(samples=1), Processes(), lambda *_: None)

    trunk = run.learner.critic.trunk
    assert (trunk.stem.out_channels, len(trunk.blocks)) == (4, 0)
    with pytest.raises(InputError, match="critic_channels is 0; it must be at least 1"):
        PpoSettings().with_(["critic_channels=0"])


def test_a_run_that_goes_on_keeps_the_teacher_that_it_was_cloned_from(tmp_path: Path) -> None:
    folder = RunFolder(tmp_path / "run")
    folder.create({})
    settings = replace(SETTINGS, teacher_kl=0.1)
    asked = iter(range(1_000))

    def run(should_stop: Callable[[], bool]) -> PpoRun:
        made = PpoRun(folder, settings, "clone:rush", Budget(samples=700), Processes(), lambda *_: None)
        made.train(should_stop)
        return made

    run(lambda: next(asked) >= 4)
    second = run(lambda: False)

    cloned = load_checkpoint(folder.path / START).network.state_dict()
    assert second.counts.sittings == 2
    assert second.learner.teacher is not None
    kept = second.learner.teacher.state_dict()  # in bf16, where the processor is fast at that
    assert all(torch.equal(one.to(kept[name].dtype), kept[name]) for name, one in cloned.items())
    with (folder.path / METRICS).open(encoding="utf-8", newline="") as file:
        told = [row["teacher_kl"] for row in csv.DictReader(file) if row["stage"] == "ppo"]
    assert any(float(one) > 0 for one in told[1:] if one)


def test_scripts_that_win_are_met_more_often_and_selves_as_before() -> None:
    shares = {"self": 0.3, "best": 0.1, "rush": 0.4, "random": 0.2}

    met = prioritise(shares, {"rush": 0.9, "random": 0.1, "self": 0.5, "best": 0.2}, 2.0)

    assert sum(met.values()) == pytest.approx(1)
    assert (met["self"], met["best"]) == (0.3, 0.1)
    assert met["random"] > 0.5 > 0.1 > met["rush"] > 0.02
    assert prioritise(shares, {"rush": 0.9}, 0.0) == pytest.approx(shares)
    assert prioritise(shares, {}, 2.0) == pytest.approx(shares)


@pytest.mark.parametrize("priority", [0.0, 2.0])
def test_a_run_with_priorities_seats_scripts_anew_by_how_they_fare(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, priority: float
) -> None:
    monkeypatch.setattr(ppo_run, "RESEAT_EVERY", 1)
    settings = replace(SETTINGS, opponents={"self": 0.5, "rush": 0.25, "random": 0.25}, priority=priority)
    folder = RunFolder(tmp_path / "run")
    folder.create({})
    run = PpoRun(folder, settings, "", Budget(samples=150), Processes(), lambda *_: None)

    def say_how_they_fare() -> bool:
        run.scores |= {"rush": 1.0, "random": 0.0}
        return False

    run.train(say_how_they_fare)
    rows = {name: len(mine) for name, mine in run.actors["paper"].groups[0].opponents.rows.items()}

    assert rows == ({"random": 4} if priority else {"rush": 2, "random": 2})
    assert len(run.actors["paper"].groups[0].opponents.self_rows) == 4


def test_the_next_rollout_is_played_while_one_is_learned_from_if_it_may_be(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    begun: Semaphore = Semaphore(0)
    learned: list[bool] = []
    play, learn = PpoRun._play, Learner.learn

    def note_beginning(run: PpoRun, rules: str, network: TeamNetwork) -> ppo_run.Rollout:
        begun.release()
        return play(run, rules, network)

    def learn_once_the_next_is_played(*given: Any) -> dict[str, float]:
        if not learned:
            begun.acquire()  # the first, which nobody could play meanwhile
        learned.append(begun.acquire(timeout=30))
        return learn(*given)

    monkeypatch.setattr(PpoRun, "_play", note_beginning)
    monkeypatch.setattr(Learner, "learn", learn_once_the_next_is_played)
    settings = replace(SETTINGS, overlap=True, opponents={"self": 0.5, "best": 0.5})
    folder = RunFolder(tmp_path / "run")
    folder.create({})
    run = PpoRun(folder, settings, "", Budget(samples=200), Processes(), lambda *_: None)

    assert run.train(lambda: False)
    assert len(learned) == run.counts.rollouts > 1
    assert all(learned)


@pytest.mark.parametrize("method", ["ppo", "distil"])
def test_a_run_may_begin_from_a_network_that_ships_by_its_name(method: str) -> None:
    given = {"rules": None, "seed": 1, "assignments": [], "data": ["seen"] if method == "distil" else []}

    config = make_config(method, "reflex", Budget(), **given)  # type: ignore[arg-type]

    assert read_student(config.start, TeamNetwork(TeamShape())).shape == TeamShape()
    assert make_config(method, "other.safetensors", Budget(), **given).start == "other.safetensors"  # type: ignore[arg-type]


@pytest.mark.parametrize("method", ["ppo", "distil"])
def test_a_run_has_the_shape_of_the_network_that_it_begins_from(tmp_path: Path, method: str) -> None:
    small = TeamNetwork(TeamShape(channels=8, blocks=1))
    file = tmp_path / "one.safetensors"
    save_checkpoint(file, small.state_dict(), describe(small, PAPER, {}))

    def shape_of(*assignments: str) -> tuple[int, int]:
        data = ["seen"] if method == "distil" else []
        settings = make_config(method, str(file), Budget(), rules=None, seed=1, assignments=assignments, data=data).settings
        assert not isinstance(settings, ReinforceSettings)
        return settings.channels, settings.blocks

    assert shape_of() == (8, 1)
    assert shape_of("channels=16") == (16, 1)  # which is refused once it is read


def test_a_start_of_another_shape_or_kind_is_refused_with_the_way_out(tmp_path: Path) -> None:
    small, alone = TeamNetwork(TeamShape(channels=8, blocks=1)), PaperTeam()
    save_checkpoint(tmp_path / "one.safetensors", small.state_dict(), describe(small, PAPER, {}))
    save_checkpoint(tmp_path / "alone.safetensors", alone.state_dict(), describe(alone, PAPER, {}))

    assert read_start(tmp_path / "one.safetensors", PAPER, small).shape == small.shape
    with pytest.raises(InputError, match=r"the settings ask for .*channels=48.* \(try --set channels=8 --set blocks=1\)$"):
        read_start(tmp_path / "one.safetensors", PAPER, TeamNetwork(TeamShape()))
    with pytest.raises(
        InputError, match=r"alone\.safetensors: its network is of the kind paper, and one of the kind team is wanted$"
    ):
        read_start(tmp_path / "alone.safetensors", PAPER, small)


@pytest.mark.parametrize(("start", "hint"), [("chmpion", "did you mean 'champion'"), ("0", "known: a checkpoint's file, ")])
def test_a_start_that_is_neither_a_file_nor_a_name_is_refused_with_a_hint(start: str, hint: str) -> None:
    with pytest.raises(InputError, match=f"^unknown start '{start}'; {hint}"):
        make_config("ppo", start, Budget(), rules=None, seed=1, assignments=[])


def test_a_best_response_meets_one_fighter_alone_and_tells_its_score_with_an_interval(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(opponents, "_LEAST_NEWEST", 2)
    given = {
        "rules": None,
        "seed": 1,
        "assignments": ["games=4", "horizon=100", "channels=8", "blocks=1", "minibatch=400", "epochs=1"],
    }
    config = make_config("ppo", "", Budget(samples=400), against="patrol", **given)  # type: ignore[arg-type]
    folder, told = RunFolder(tmp_path / "run"), []
    folder.create(config.to_dict())
    settings = config.settings
    assert isinstance(settings, PpoSettings)

    def go_on(samples: int) -> PpoRun:
        run = PpoRun(folder, settings, "", Budget(samples=samples), Processes(), lambda _, text: told.append(text))
        run.train(lambda: False)
        return run

    first = go_on(400)
    second = go_on(800)
    with (folder.path / METRICS).open(encoding="utf-8", newline="") as file:
        last = list(csv.DictReader(file))[-1]

    assert settings.opponents == {"patrol": 1.0}
    assert 0 <= float(last["newest_low"]) <= float(last["newest"]) <= float(last["newest_high"]) <= 1
    assert len(second.newest.points) > len(first.newest.points) >= 2
    assert "score against patrol 0." in told[-1]


@pytest.mark.parametrize(
    ("method", "against", "sets", "reason"),
    [
        ("reinforce", "champion", [], "--against is for the method ppo"),
        ("ppo", "champion", ["opponents.rush=0.1"], "names the only opponent"),
        ("ppo", "best", [], "a best response is to a fighter that stays as it is"),
        ("ppo", "champoin", [], "champoin"),
    ],
)
def test_who_cannot_be_responded_to_is_refused(method: str, against: str, sets: list[str], reason: str) -> None:
    with pytest.raises(ArenaError, match=reason):
        make_config(method, "", Budget(), rules=None, seed=1, assignments=sets, against=against)
