"""Demonstrations: what a teacher would order in a learner's place, kept in files; and learning from them."""

import csv
import multiprocessing
import zlib
from collections.abc import Callable, Iterator
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import pytest
import torch
from small import PAPER, SMALL

from arena.errors import ArenaError, InputError
from policies.networks.checkpoint import describe, load_checkpoint, save_checkpoint
from policies.networks.features import ONE, Plane
from policies.networks.models import PaperTeam, TeamNetwork
from policies.registry import shipped
from policies.training.budget import Budget
from policies.training.demonstrate import DemonstrationSettings, Demonstrator, check, demonstrate
from policies.training.demonstrations import CERTAIN, UNKNOWN, DemonstrationFolder, Demonstrations, mirrored
from policies.training.distil_run import DistilRun
from policies.training.distil_settings import DistilSettings
from policies.training.folder import LAST, METRICS, RunFolder
from policies.training.gather import gather_alone
from policies.training.gradients import TrainingError
from policies.training.parallel import Processes
from policies.training.sample_folder import File
from policies.training.sample_run import choose_unseen

SMALL_RUN = ("--set", "channels=8", "--set", "blocks=1", "--set", "passes=1")
EASY = DemonstrationSettings(teacher="rush", games=4, opponents={"self": 0.5, "patrol": 0.5})


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> DemonstrationFolder:
    """Three files of `rush` against itself and `patrol`; the second is not learned from."""
    folder = DemonstrationFolder(tmp_path_factory.mktemp("data"))
    folder.open_for(asdict(EASY), PAPER)
    for sitting in range(3):
        gather_alone(folder, Demonstrator, EASY, 0, sitting, 6, lambda: False)
    return folder


@pytest.fixture
def student(tmp_path: Path) -> str:
    torch.manual_seed(0)
    network = TeamNetwork(SMALL)
    save_checkpoint(tmp_path / "student.safetensors", network.state_dict(), describe(network, PAPER, {}))
    return str(tmp_path / "student.safetensors")


def test_what_a_teacher_orders_is_legal_and_each_match_has_one_outcome(data: DemonstrationFolder) -> None:
    files = data.files()
    samples = [data.read(file.path) for file in files]

    assert [(file.matches, file.samples) for file in files] == [(6, len(one.outcome)) for one in samples]
    for one in samples:
        lives = one.labels != UNKNOWN
        chosen = np.maximum(one.labels, 0)[..., None].astype(np.int64)
        assert lives.any()
        assert np.take_along_axis(one.legal, chosen, 2)[lives].all()
        assert (np.take_along_axis(one.chances, chosen, 2)[lives] == CERTAIN).all()  # a script is sure
        assert set(np.unique(one.outcome)) <= {-1.0, 0.0, 1.0}
        begins = np.flatnonzero(one.scalars[:, 0] == 0)
        assert len(begins) == 6
        assert all((part == part[0]).all() for part in np.split(one.outcome, begins[1:]))


def test_demonstrations_know_where_the_enemies_truly_are_whether_seen_or_not(data: DemonstrationFolder) -> None:
    samples = data.read(data.files()[0].path)
    seen = samples.planes[..., Plane.ENEMY_UGV : Plane.ENEMY_UAV + 1] // ONE

    np.testing.assert_array_equal(samples.enemies[seen > 0], seen[seen > 0])
    np.testing.assert_array_equal(samples.enemies.sum((1, 2))[samples.scalars[:, 0] == 0], np.tile([4, 2], (6, 1)))
    assert samples.enemies.sum() > 2 * seen.sum() > 0


def test_mirrored_samples_mean_the_same_on_a_board_turned_upside_down(data: DemonstrationFolder) -> None:
    samples = data.read(data.files()[0].path)
    everything = np.ones(len(samples.outcome), np.bool_)
    turned = mirrored(samples, everything)
    lives = turned.labels != UNKNOWN
    there = turned.planes.reshape(len(everything), -1, turned.planes.shape[-1])
    walkers = np.take_along_axis(there[..., Plane.OWN_UGV], turned.cell[:, :4].astype(np.int64), 1)

    assert (turned.labels != samples.labels).any()
    assert np.take_along_axis(turned.legal, np.maximum(turned.labels, 0)[..., None].astype(np.int64), 2)[lives].all()
    assert walkers[lives[:, :4]].all()
    seen = turned.planes[..., Plane.ENEMY_UGV]
    np.testing.assert_array_equal(turned.enemies[..., 0][seen > 0], seen[seen > 0] // ONE)
    for one, other in zip(mirrored(turned, everything), samples, strict=True):
        np.testing.assert_array_equal(one, other)
    for one, other in zip(mirrored(samples, ~everything), samples, strict=True):
        np.testing.assert_array_equal(one, other)


def test_a_learner_plays_its_share_of_the_matches_and_the_teacher_labels_them_all(student: str) -> None:
    settings = replace(EASY, student=student, own=1.0, opponents={"patrol": 1.0}, teacher="planner-fast:budget=40", games=2)
    demonstrator = Demonstrator(settings, 0, 0)
    stepped: list[np.ndarray] = []
    step, taught = demonstrator.seats.step, []
    demonstrator.seats.step = lambda seen, actions, results: (stepped.append(actions), step(seen, actions, results))[1]  # type: ignore[method-assign]
    heard: list[np.ndarray] = []
    demonstrator.teacher.hear = heard.append  # type: ignore[method-assign]

    for _ in range(5):
        list(demonstrator.play_tick())
        taught.append(np.stack([ticks[-1][4] for ticks in demonstrator._begun]))

    assert (np.array(stepped) != np.array(taught)).any()
    np.testing.assert_array_equal(heard, stepped)


def test_processes_of_their_own_make_demonstrations_until_they_are_stopped_and_the_same_command_goes_on(tmp_path: Path) -> None:
    folder, settings = DemonstrationFolder(tmp_path / "data"), replace(EASY, file_samples=100)

    def make(n: int, stop: Callable[[], bool]) -> bool:
        return demonstrate(folder, settings, n, 1, lambda *_: None, stop)

    def end_all() -> bool:
        """Send a request to end to all processes at once, as a job's manager does, when something was written."""
        for worker in multiprocessing.active_children() if folder.files() else ():
            worker.terminate()
        return bool(folder.files())

    assert not make(1_000_000, end_all)
    kept = folder.files()
    (folder.path / f".{kept[0].path.name}.77").write_bytes(b"half a file of somebody who was killed")
    assert all(len(folder.read(file.path).outcome) == file.samples for file in kept)
    assert make(sum(file.matches for file in kept), lambda: False)
    assert folder.files() == kept
    with pytest.raises(InputError, match=r"another value of seed; choose another --out"):
        demonstrate(folder, replace(settings, seed=2), 4, 1, lambda *_: None, lambda: False)
    with folder.hold(), pytest.raises(InputError, match=r"^another process is making demonstrations in "):
        make(1_000_000, lambda: True)
    (folder.path / "demonstrations.json").write_text("[]")
    with pytest.raises(InputError, match=r"demonstrations\.json: it is not as it was written"):
        folder.check()


class UnlikeSeats:
    """Stands for a `Demonstrator` of five seats: in the first a match takes one tick, in the second two, and so on."""

    def __init__(self, *_: object) -> None:
        self.n_seats, self.tick = 5, 0

    def play_tick(self) -> Iterator[tuple[int, Demonstrations]]:
        self.tick += 1
        for seat in range(5):
            if self.tick % (seat + 1) == 0:
                yield seat, Demonstrations(*[np.full(seat + 1, seat)] * len(Demonstrations._fields))


@pytest.mark.parametrize(("n_matches", "sitting", "kept"), [(10, 0, [2] * 5), (12, 7, [2, 3, 2, 2, 3]), (2, 0, [0, 0, 1, 0, 1])])
def test_long_matches_are_kept_as_often_as_short_ones(tmp_path: Path, n_matches: int, sitting: int, kept: list[int]) -> None:
    folder = DemonstrationFolder(tmp_path)
    gather_alone(folder, UnlikeSeats, replace(EASY, file_samples=7), 0, sitting, n_matches, lambda: False)
    seats = np.concatenate([folder.read(file.path).outcome for file in folder.files()])

    assert [int((seats == seat).sum()) // (seat + 1) for seat in range(5)] == kept
    assert sum(file.matches for file in folder.files()) == n_matches


def test_files_are_listed_by_process_and_number(tmp_path: Path) -> None:
    for name in ("10-00001-1-9", "2-100000-1-9", "2-99999-1-9", "2-00002-1-9"):
        (tmp_path / f"{name}.npz").touch()

    found = [(file.process, file.number) for file in DemonstrationFolder(tmp_path).files()]

    assert found == [(2, 2), (2, 99_999), (2, 100_000), (10, 1)]


def named(*numbers: tuple[int, int]) -> list[File]:
    return [File(Path(f"{process}-{number}"), process, number, 1, 1) for process, number in numbers]


def test_one_file_in_ten_is_not_learned_from_and_of_each_process_another() -> None:
    files = named(*((process, number) for process in range(20) for number in range(1, 41)))
    unseen = choose_unseen(files)

    assert {file.number for file in unseen if file.process == 0} == {2, 12, 22, 32}
    for number in range(1, 41):  # early or late, the same share is held out
        assert sum(file.number == number for file in unseen) == 2
    for process in range(20):
        assert sum(file.process == process for file in unseen) == 4


def test_a_folder_that_grows_moves_no_file_between_learned_and_unseen() -> None:
    files = named(*((process, number) for number in range(1, 26) for process in range(3) if (process, number) != (0, 12)))
    before: set[File] = set()
    for n in range(len(files) + 1):
        unseen = choose_unseen(files[:n])
        assert unseen - before <= {files[n - 1]}
        assert before <= unseen
        before = unseen


def test_where_a_file_was_deleted_the_next_one_is_unseen() -> None:
    assert choose_unseen(named((0, 1), (0, 3), (0, 4))) == set(named((0, 3)))
    assert choose_unseen(named((0, 1), (0, 2), (0, 3), (0, 4))) == set(named((0, 2)))


def test_a_folder_that_is_deleted_meanwhile_is_one_sentence_and_ends_the_processes(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    folder = DemonstrationFolder(tmp_path / "data")

    def delete_once_written(share: float, _: str) -> None:
        if share:
            folder.path.rename(tmp_path / "away")  # at once, whoever writes there meanwhile

    with pytest.raises(InputError, match=r"^the folder .*/data was deleted; the same command begins anew$"):
        demonstrate(folder, replace(EASY, file_samples=100), 1_000_000, 1, delete_once_written, lambda: False)
    for process in multiprocessing.active_children():
        process.join()
        assert process.exitcode == 0
    assert "Traceback" not in capfd.readouterr().err


def learn(path: Path, data: DemonstrationFolder, stop: Callable[[], bool] = lambda: False, **settings: float) -> DistilRun:
    folder = RunFolder(path)
    path.mkdir(exist_ok=True)
    chosen = DistilSettings(data=[str(data.path)], channels=8, blocks=1, minibatch=64, **settings)  # type: ignore[arg-type]
    run = DistilRun(folder, chosen, "", Budget(), Processes(), lambda *_: None)
    run.train(stop)
    return run


def test_learning_from_demonstrations_brings_the_learner_to_agree_with_the_teacher(
    tmp_path: Path, data: DemonstrationFolder
) -> None:
    run = learn(tmp_path / "run", data, passes=16.0, rate=1e-2, average=0.8, belief=1.0)
    with (run.folder.path / METRICS).open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))

    assert run.progress >= 1
    assert float(rows[-1]["unseen_agreed"]) > max(float(rows[0]["agreed"]), 0.3) + 0.1
    assert float(rows[-1]["value_loss"]) < float(rows[0]["value_loss"])
    assert float(rows[-1]["unseen_belief_loss"]) < float(rows[0]["unseen_belief_loss"]) - 0.05
    assert load_checkpoint(run.folder.path / LAST).manifest.training["method"] == "distil"


def test_a_run_that_was_stopped_ends_with_the_weights_of_one_that_was_not(tmp_path: Path, data: DemonstrationFolder) -> None:
    asked = iter(range(10))
    learn(tmp_path / "stopped", data, lambda: next(asked) >= 2, passes=4.0)
    stopped = learn(tmp_path / "stopped", data, passes=4.0)
    whole = learn(tmp_path / "whole", data, passes=4.0)

    assert stopped.counts.step == whole.counts.step == 4
    for name, one in whole.average.items():
        torch.testing.assert_close(stopped.average[name], one, rtol=0, atol=0)


def test_demonstrations_of_several_rulesets_are_learned_from_together(tmp_path: Path, data: DemonstrationFolder) -> None:
    alone, settings = DemonstrationFolder(tmp_path / "alone"), replace(EASY, rules="exp1")
    alone.open_for(asdict(settings), check(settings))
    for sitting in range(2):
        gather_alone(alone, Demonstrator, settings, 0, sitting, 2, lambda: False)
    both = DistilSettings(data=[str(data.path), str(alone.path)], channels=8, blocks=1, passes=1.0, minibatch=64)
    run = DistilRun(RunFolder(tmp_path), both, "", Budget(), Processes(), lambda *_: None)
    run.train(lambda: False)

    assert run.progress >= 1
    learned = [data.files()[0], data.files()[2], alone.files()[0]]  # the others show how it fares
    assert run.counts.samples == sum(file.samples for file in learned)


def test_a_gradient_that_is_not_finite_ends_the_run_before_the_step(tmp_path: Path, data: DemonstrationFolder) -> None:
    rotten = DemonstrationFolder(tmp_path / "rotten")
    rotten.open_for({}, PAPER)
    samples = data.read(data.files()[0].path)
    for _ in range(2):
        rotten.add(0, [samples._replace(scalars=np.full_like(samples.scalars, np.nan))])
    folder = RunFolder(tmp_path / "run")
    run = DistilRun(
        folder, DistilSettings(data=[str(rotten.path)], channels=8, blocks=1), "", Budget(), Processes(), lambda *_: None
    )
    before = {name: one.clone() for name, one in run.network.state_dict().items()}

    with pytest.raises(TrainingError, match="not finite"):
        run.train(lambda: False)

    assert all(torch.equal(one, before[name]) for name, one in run.network.state_dict().items())


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"student": "rush"}, "the student is 'rush'; it must be a checkpoint's file, or one of champion"),
        ({"student": "paper"}, "its network is of the kind paper, and one of the kind team is wanted"),
        ({"student": "nowhere.safetensors"}, "cannot read the checkpoint nowhere.safetensors"),
        ({"teacher": "nobody"}, "nobody"),
        ({"opponents": {"best": 1.0}}, "names best, which PPO alone has"),
        ({"own": 2.0}, "the setting own is 2.0"),
    ],
)
def test_who_cannot_teach_play_or_learn_is_refused_in_a_sentence(change: dict[str, object], reason: str) -> None:
    assert "paper" in shipped()
    assert isinstance(load_checkpoint(shipped()["paper"]).network, PaperTeam)
    with pytest.raises(ArenaError, match=reason):
        check(replace(EASY, **change))  # type: ignore[arg-type]


def test_a_planner_does_not_teach_where_it_cannot_look_ahead(tmp_path: Path) -> None:
    rules = tmp_path / "wide.toml"
    rules.write_text('base = "paper"\nside = 42\n')
    with pytest.raises(InputError, match="planner-fast cannot teach under wide: it looks ahead on boards of up to 40 cells"):
        check(replace(EASY, teacher="planner-fast", rules=str(rules)))


def test_demonstrations_that_do_not_fit_are_refused_in_a_sentence(tmp_path: Path, data: DemonstrationFolder) -> None:
    with pytest.raises(InputError, match="there are no demonstrations in"):
        DemonstrationFolder(tmp_path).check()
    exp1 = DistilSettings(rules="exp1", data=[str(data.path)])
    with pytest.raises(InputError, match="there are no demonstrations of ruleset exp1 in"):
        DistilRun(RunFolder(tmp_path), exp1, "", Budget(), Processes(), lambda *_: None)
    old = DemonstrationFolder(tmp_path / "old")
    old.open_for({"rules": "paper"}, PAPER)
    [manifest] = old.path.iterdir()
    manifest.write_text(manifest.read_text().replace('"features": 1', '"features": 0'))
    with pytest.raises(InputError, match="are of features 0; 1 is wanted here"):
        old.check()
    with pytest.raises(InputError, match="give a folder by --data"):
        DistilSettings()
    few = DemonstrationFolder(tmp_path / "few")
    few.open_for({}, PAPER)
    file = few.add(0, [data.read(data.files()[0].path)])
    with pytest.raises(InputError, match="too few demonstrations"):
        learn(tmp_path / "run", few)
    file.path.write_bytes(file.path.read_bytes()[: file.path.stat().st_size // 2])
    with pytest.raises(InputError, match="delete it, and the rest can be used"):
        few.read(file.path)


def test_a_damaged_file_is_one_sentence_wherever_it_is_damaged(tmp_path: Path, data: DemonstrationFolder) -> None:
    whole = data.files()[0].path.read_bytes()
    file, rng, reasons = tmp_path / "damaged.npz", np.random.default_rng(0), set[type]()
    damages = [b"", whole[:-1], *(whole[:at] + bytes(range(64)) + whole[at + 64 :] for at in rng.integers(len(whole), size=40))]
    for damaged in damages:
        file.write_bytes(damaged)
        with pytest.raises(InputError, match=r"^cannot read .+: .+; delete it, and the rest can be used$") as refusal:
            data.read(file)
        reasons.add(type(refusal.value.__cause__))

    assert {zlib.error, EOFError} < reasons


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ("data=5", "the setting data is 5; it must be a list of folders"),
        ("data=[1]", r"the setting data is \[1\]; it must be a list of folders"),
        ("data='runs'", "the setting data is 'runs'; it must be a list of folders"),
    ],
)
def test_data_that_is_no_list_of_folders_is_refused_in_a_sentence(change: str, reason: str) -> None:
    with pytest.raises(InputError, match=reason):
        DistilSettings(data=["runs/seen"]).with_([change])


def test_a_network_that_no_checkpoint_can_hold_is_refused_before_anything_is_made(
    train: Callable[..., None], tmp_path: Path, data: DemonstrationFolder, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit):
        train("--method", "distil", "--data", data.path, "--out", tmp_path / "run", "--set", "channels=300")

    assert "a network of channels=300 and blocks=3 would take " in capsys.readouterr().err
    assert not (tmp_path / "run").exists()


def test_the_commands_make_and_learn_from_the_same_folders(
    train: Callable[..., None], tmp_path: Path, data: DemonstrationFolder, capsys: pytest.CaptureFixture[str]
) -> None:
    train("--method", "distil", "--data", data.path, "--out", tmp_path / "run", *SMALL_RUN)
    with pytest.raises(SystemExit):
        train("demonstrate", "--out", data.path, "--teacher", "rush", "--matches", 12)
    said = capsys.readouterr()

    assert f"trained: {tmp_path / 'run' / LAST}" in said.out
    assert "were made with another value of games, opponents; choose another --out" in said.err
