"""The environments pass the tests of those whose faces they wear, and play the very game that the referee plays."""

import pickle
import subprocess
import sys
import warnings
from collections.abc import Iterator
from copy import deepcopy
from typing import Any, ClassVar

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env, data_equivalence
from gymnasium.vector import VectorEnv
from pettingzoo.test import parallel_api_test, parallel_seed_test, render_test, state_test
from pettingzoo.utils import parallel_to_aec

from arena.envs import ParallelCapture, parallel_env
from arena.envs.episodes import SteppedError
from arena.envs.render import CELL_PX
from arena.errors import ArenaError, UnknownNameError
from arena.game.keys import MatchKeys
from arena.game.observation import Observation
from arena.game.ruleset import load
from arena.game.types import Action, Team, Termination
from arena.local.venue import play
from arena.policy import MatchResult
from arena.protocol.observation_codec import ObservationWriter, without_clock
from arena.records.journal import Journal, read_journal
from arena.records.plan import MatchPlan
from arena.records.verification import watch
from policies.each_seat import EachSeatFactory
from policies.environments import make_single, make_vector
from policies.registry import load as load_fighter

ID = "policies.environments:arena/CaptureTheFlag-v0"
SMALL = load("paper").with_({"side": 10, "tick_limit": 30})
KEYS = MatchKeys(map_key=b"\x07" * 32, match_key=b"\x09" * 32)


@pytest.fixture(scope="module")
def journal() -> Journal:
    """A match of `fighter` against `rush`, in the local venue."""
    plan = MatchPlan(identity="envs/0", blue="fighter", red="rush", keys=KEYS)
    (record,) = play(SMALL, [plan], load_fighter, n_workers=1)
    assert record.journal is not None
    return read_journal(record.journal)


def orders_of(journal: Journal) -> Iterator[dict[Team, np.ndarray]]:
    n_blue = len(journal.header.ruleset.team(Team.BLUE))
    for tick in journal.ticks:
        orders = np.frombuffer(tick.orders, np.int8)
        yield {Team.BLUE: orders[:n_blue], Team.RED: orders[n_blue:]}


def wire(env: Any) -> dict[Team, bytes]:
    """Return what each seat would be sent now, on the network."""
    games = env._episodes.game
    return {team: without_clock(ObservationWriter(seen, 0).write()) for team, seen in games.observe().items()}


@pytest.mark.parametrize("agents", ["units", "teams"])
@pytest.mark.parametrize("rules", ["paper", "exp1", "gym-cap"])
def test_pettingzoo_s_own_tests_pass(rules: str, agents: str) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        parallel_api_test(parallel_env(rules, agents), num_cycles=200)
        parallel_seed_test(lambda: parallel_env(rules, agents), num_cycles=50)


def test_pettingzoo_s_test_of_the_state_passes() -> None:
    env = parallel_env(SMALL, "teams")
    state_test(parallel_to_aec(env), env)


def test_pettingzoo_s_render_test_passes(capsys: pytest.CaptureFixture[str]) -> None:
    render_test(lambda render_mode: parallel_to_aec(parallel_env(SMALL, "teams", render_mode=render_mode)))

    assert capsys.readouterr().out.count("F") >= 2, "a person is shown every tick"


@pytest.mark.parametrize("team", ["blue", "red"])
def test_gymnasium_s_own_test_passes(team: str) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(gymnasium.make(ID, opponent="rush", team=team, render_mode="rgb_array").unwrapped)


@pytest.mark.parametrize(
    "how", ["import policies.environments; env = gymnasium.make('arena/CaptureTheFlag-v0')", f"env = gymnasium.make({ID!r})"]
)
def test_gymnasium_finds_it(how: str) -> None:
    code = f"import gymnasium; {how}; env.reset(seed=1); print(env.step(env.action_space.sample())[2])"
    done = subprocess.run([sys.executable, "-W", "error", "-c", code], capture_output=True, text=True, timeout=120, check=False)

    assert (done.stdout, done.returncode) == ("False\n", 0), done.stderr


@pytest.mark.parametrize("agents", ["units", "teams"])
def test_the_same_keys_and_orders_give_the_bytes_of_the_local_venue_and_of_the_network(journal: Journal, agents: str) -> None:
    env = parallel_env(SMALL, agents)
    env.reset(options={"keys": KEYS})
    shown = watch(journal)
    totals = dict.fromkeys(env.possible_agents, 0.0)

    for tick, orders in enumerate(orders_of(journal)):
        assert wire(env) == {team: shown[team][tick] for team in Team}
        if agents == "teams":
            actions: dict[str, Any] = {team.name.lower(): orders[team] for team in Team}
        else:
            actions = {agent: orders[env._seats[agent][0]][env._seats[agent][1]] for agent in env.agents}
        _, rewards, _, _, infos = env.step(actions)
        for agent, reward in rewards.items():
            totals[agent] += reward

    assert env.agents == []
    assert journal.ending is not None
    assert {info["ending"] for info in infos.values()} == {journal.ending.ending}
    if agents == "teams":
        assert totals["blue"] == pytest.approx(journal.ending.score / 100)
        assert totals["red"] == pytest.approx(-journal.ending.score / 100)


@pytest.mark.parametrize("team", list(Team))
def test_an_opponent_plays_as_it_does_in_the_local_venue(journal: Journal, team: Team) -> None:
    opponent = (journal.header.blue, journal.header.red)[team.other]
    env = make_single(opponent, team=team.name.lower(), ruleset=SMALL)
    env.reset(options={"keys": KEYS})
    total, shown = 0.0, watch(journal)

    for tick, orders in enumerate(orders_of(journal)):
        assert wire(env) == {side: shown[side][tick] for side in Team}
        _, reward, is_over, is_cut, _ = env.step(orders[team])
        total += reward

    assert journal.ending is not None
    assert (is_over, is_cut) == (True, False)
    assert total == pytest.approx((journal.ending.score if team is Team.BLUE else -journal.ending.score) / 100)


def test_what_is_observed_is_what_the_observation_says(journal: Journal) -> None:
    env = parallel_env(SMALL, "teams")
    observations, _ = env.reset(options={"keys": KEYS})
    n_enemies = 0
    for orders in orders_of(journal):
        for team in Team:
            told, seen = observations[team.name.lower()], env._episodes.game.observe()[team].seat(0, SMALL)
            assert (told["grid"] == seen.grid).all()
            assert [(row, column, bool(alive)) for row, column, _, alive in told["units"].tolist()] == [
                (unit.row, unit.column, unit.alive) for unit in seen.units
            ]
            in_sight = [(row, column, SMALL.units[kind].name) for row, column, kind in told["enemies"].tolist() if row >= 0]
            assert in_sight == [(enemy.row, enemy.column, enemy.type) for enemy in seen.enemies]
            assert (told["legal_actions"] == seen.legal_actions).all()
            assert (tuple(told["living"]), told["score"][0], told["tick"][0]) == (seen.living, seen.score, seen.tick)
            n_enemies += len(in_sight)
        observations = env.step({team.name.lower(): orders[team] for team in Team})[0]
    assert n_enemies


def test_a_unit_that_falls_leaves_and_its_team_plays_on() -> None:
    env = parallel_env(SMALL, "units")
    rng = np.random.default_rng(3)
    for seed in range(20):
        env.reset(seed=seed)
        while env.agents:
            before = set(env.agents)
            observations, _, over, cut, _ = env.step({agent: int(rng.integers(5)) for agent in env.agents})
            fallen = before - set(env.agents)
            assert not any(cut.values())
            assert fallen == {agent for agent, is_over in over.items() if is_over}
            if fallen and env.agents:
                assert all(observations[agent]["self"][-1] == 0 for agent in fallen)
                return
    raise AssertionError("nobody fell in 20 matches")


def test_rows_of_the_vector_form_play_as_the_single_one_does() -> None:
    many = gymnasium.make_vec(ID, num_envs=3, vectorization_mode="vector_entry_point", opponent="fighter", ruleset=SMALL)
    assert isinstance(many, VectorEnv)
    rows = [make_single("fighter", ruleset=SMALL) for _ in range(3)]
    seen, _ = many.reset(seed=11)
    alone = [env.reset(seed=11 + row)[0] for row, env in enumerate(rows)]
    rng, n_ended, is_anew = np.random.default_rng(5), 0, [False] * 3

    for _ in range(100):
        assert seen in many.observation_space
        for row, one in enumerate(alone):
            assert all((seen[name][row] == values).all() for name, values in one.items())
        actions = rng.integers(0, 5, (3, 6))
        seen, rewards, over, cut, _ = many.step(actions)
        for row, env in enumerate(rows):
            if is_anew[row]:
                alone[row], reward, is_anew[row] = env.reset()[0], 0.0, False
                n_ended += 1
            else:
                alone[row], reward, is_anew[row], _, _ = env.step(actions[row])
            assert (rewards[row], over[row], cut[row]) == (pytest.approx(reward), is_anew[row], False)
    assert n_ended >= 3


def test_the_outcome_is_paid_at_the_end() -> None:
    env = make_single("random", ruleset=SMALL, reward="outcome")
    for seed in range(5):
        env.reset(seed=seed)
        rewards, is_over = [], False
        while not is_over:
            _, reward, is_over, _, _ = env.step(np.full(6, Action.STAY))
            rewards.append(reward)
        assert set(rewards[:-1]) <= {0.0}
        assert rewards[-1] == np.sign(env._episodes._score)


def test_a_picture_has_a_square_for_each_cell() -> None:
    env = parallel_env(SMALL, "teams", render_mode="rgb_array")
    env.reset(seed=1)
    picture = env.render()

    assert isinstance(picture, np.ndarray)
    assert picture.shape == (10 * CELL_PX, 10 * CELL_PX, 3)
    assert len(np.unique(picture[::CELL_PX, ::CELL_PX].reshape(-1, 3), axis=0)) == len(np.unique(env.state()))


@pytest.mark.parametrize(
    ("make", "sentence"),
    [
        (lambda: parallel_env("paper", agents="squads"), "squads"),
        (lambda: parallel_env("paper", reward="money"), "money"),
        (lambda: parallel_env("paper", render_mode="oil"), "oil"),
        (lambda: parallel_env("papr"), "papr"),
        (lambda: make_single("nobody"), "nobody"),
        (lambda: make_single("rush", team="green"), "green"),
        (lambda: make_vector(2, reward="money"), "money"),
    ],
)
def test_a_wrong_name_is_said(make: Any, sentence: str) -> None:
    with pytest.raises(UnknownNameError, match=sentence):
        make()


def test_a_match_that_is_over_or_was_not_begun_is_not_stepped() -> None:
    single, parallel, many = make_single("rush", ruleset=SMALL), parallel_env(SMALL, "teams"), make_vector(2, ruleset=SMALL)
    for env, actions in ((single, np.zeros(6)), (parallel, {}), (many, np.zeros((2, 6)))):
        with pytest.raises(SteppedError, match=r"call reset\(\) first"):
            env.step(actions)  # type: ignore[attr-defined]
    parallel.reset(seed=1)
    while parallel.agents:
        parallel.step(dict.fromkeys(parallel.agents, np.zeros(6, np.int64)))
    assert parallel.step({}) == ({}, {}, {}, {}, {})
    with pytest.raises(SteppedError, match="it is over"):
        parallel.step({"blue": np.zeros(6, np.int64)})
    single.reset(seed=1)
    while not single.step(np.zeros(6, np.int64))[2]:
        pass

    with pytest.raises(SteppedError, match="it is over"):
        single.step(np.zeros(6, np.int64))


@pytest.mark.parametrize("actions", [[0] * 5, [5] * 6, [-1] * 6, [0.5] * 6, ["north"] * 6, None, [[0] * 6], [[0], [0, 1]]])
def test_what_are_no_actions_is_refused_in_a_sentence(actions: Any) -> None:
    env = make_single("rush", ruleset=SMALL)
    env.reset(seed=1)

    with pytest.raises(SteppedError, match="the actions of blue must be 6 whole numbers from 0 to 4"):
        env.step(actions)


@pytest.mark.parametrize("change", [{"agent_7": 1}, {"red_0": None}, {"red_0": 9}])
def test_actions_of_others_or_none_are_refused(change: dict[str, Any]) -> None:
    env: ParallelCapture = parallel_env(SMALL)
    env.reset(seed=1)
    actions = {**dict.fromkeys(env.agents, 0), **change}

    with pytest.raises(ArenaError, match=r"actions of"):
        env.step({agent: action for agent, action in actions.items() if action is not None})


def test_an_opponent_may_be_a_class() -> None:
    env = make_single(load_fighter("patrol"), ruleset=SMALL)
    env.reset(seed=1)

    assert env.step(np.zeros(6, np.int64))[1] == 0.0


class Diary:
    """Stays, and notes for each match how often it was asked, and how the match ended."""

    matches: ClassVar[list["Diary"]] = []

    def __init__(self) -> None:
        self.n_asked, self.results = 0, list[MatchResult]()
        self.matches.append(self)

    def act(self, observation: Observation) -> list[int]:
        assert not self.results, "its match is over"
        self.n_asked += 1
        return [0] * len(observation.units)

    def end(self, result: MatchResult) -> None:
        self.results.append(result)


@pytest.mark.parametrize("mode", [None, "NextStep", "SameStep"])
def test_an_opponent_hears_how_each_of_its_matches_ended_and_is_asked_no_more(mode: str | None) -> None:
    Diary.matches = []
    options: dict[str, Any] = {"opponent": EachSeatFactory(Diary), "team": "red", "ruleset": SMALL.with_({"tick_limit": 4})}
    env = make_single(**options) if mode is None else make_vector(2, autoreset_mode=mode, **options)
    actions = np.zeros(env.action_space.shape or (), np.int64)
    for _ in range(3):
        env.reset(seed=1)
        for _ in range(4):
            env.step(actions)
    env.reset(seed=1)
    env.step(actions)
    env.reset(seed=1)

    *before, last = Diary.matches[: -1 if mode else None]
    assert not last.results, "its match goes on"
    assert {len(match.results) for match in before} == {1}
    assert all(match.results[0].ticks == match.n_asked for match in before)
    endings = [match.results[0].ending for match in before]
    assert Termination.TICK_LIMIT in endings
    assert endings[-1] is Termination.VOID


def test_an_opponent_hears_its_own_score() -> None:
    Diary.matches = []
    board = SMALL.with_({"side": 4, "board": "F..f\n..U.\n....\nu..."})
    options: dict[str, Any] = {"opponent": EachSeatFactory(Diary), "ruleset": board}
    for env, shape in ((make_single(**options), (1,)), (make_vector(1, **options), (1, 1))):
        env.reset(seed=1)
        env.step(np.full(shape, Action.NORTH))
        env.step(np.full(shape, Action.EAST))

    assert [match.results[0].score for match in Diary.matches] == [-100, -100]


@pytest.mark.parametrize("make", [make_single, make_vector, parallel_env])
def test_a_copy_of_an_environment_plays_as_it_does(make: Any) -> None:
    env = make(ruleset=SMALL, frame="own", reward="outcome")
    env.reset(seed=1)
    copies = [pickle.loads(pickle.dumps(env)), deepcopy(env)]

    for copy in copies:
        assert data_equivalence(copy.reset(seed=3), env.reset(seed=3), exact=True)
