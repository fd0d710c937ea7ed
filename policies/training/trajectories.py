"""Play some matches to their ends with one policy, and split what happened into the trajectories of the units.

Source: paper, Algorithm 1, "Generate trajectory", "Split". Blue learns; planes know only own and enemy, so nothing is lost.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from arena.envs.batched import BatchedEnv
from arena.game.observation import Observations
from arena.game.rules import can_enter, column_after, is_on_board, row_after
from arena.game.types import Action, Code, Team, Termination
from arena.policy import BatchPolicy
from policies.networks.first_person import FirstPerson
from policies.networks.learned import choose, infer_units
from policies.networks.models import N_ACTIONS, PaperTeam
from policies.training.reinforce import credit, standardise
from policies.training.reinforce_settings import ReinforceSettings
from policies.training.replay import Samples


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Outcome:
    """How the matches of a round went, one entry each."""

    score: NDArray[np.float64]
    """Blue's final score, -100 to 100: the performance of the paper's Figures 4 to 6."""
    is_won: NDArray[np.bool_]
    is_captured: NDArray[np.bool_]
    """Whether blue took the flag."""
    ticks: NDArray[np.int64]
    seen: NDArray[np.float64]
    """Mean share of the board that blue had in sight."""
    blocked: NDArray[np.float64]
    """Share of blue's steps that led off the board, or into an obstacle, so that the unit stayed."""


class _Side:
    """One team's units, when the learner plays them."""

    def __init__(self, env: BatchedEnv, team: Team, settings: ReinforceSettings) -> None:
        self.team = team
        self.flies = flies = np.array([unit.flies for unit in env.ruleset.team(team)], np.uint8)
        self._views = FirstPerson(team, env.ruleset.side, flies, env.n_games, settings.window, settings.edge_code)
        self._logits = np.zeros((env.n_games, len(flies), N_ACTIONS), np.float32)
        self._actions = np.zeros((env.n_games, len(flies)), np.int8)
        self.row, self.unit = np.zeros((2, 0), np.int64)
        """Each shape (n,): of the living units in rows that play."""

    def look(self, seen: Observations, is_playing: NDArray[np.bool_]) -> NDArray[np.int8]:
        """Return the view of each living unit in rows that play, shape (n, window, window)."""
        self.row, self.unit = np.nonzero((seen.alive > 0) & is_playing[:, None])
        return self._views.cut(seen)[self.row, self.unit]

    def draw(self, logits: NDArray[np.float32], seen: Observations, orders: NDArray[np.int8]) -> NDArray[np.int64]:
        """Write the orders of all units; return the actions of those that were looked at, in their frame, shape (n,)."""
        self._logits[self.row, self.unit] = logits
        choose(self._logits, np.ascontiguousarray(seen.seed), self._actions)
        orders[:] = self._views.to_board(self._actions)
        return self._actions[self.row, self.unit].astype(np.int64)


class RoundPlayer:
    """The board on which rounds are played: rows of matches, a view for each unit, and an opponent.

    Parameters
    ----------
    opponent
        Plays red; where it is None, the learner plays both sides, and learns from blue's.
    """

    def __init__(self, env: BatchedEnv, opponent: BatchPolicy | None, settings: ReinforceSettings) -> None:
        self.env, self.opponent, self._settings = env, opponent, settings
        played = (Team.BLUE, Team.RED) if opponent is None else (Team.BLUE,)
        self._sides = [_Side(env, team, settings) for team in played]
        self._orders = {team: np.zeros((env.n_games, len(env.ruleset.team(team))), np.int8) for team in Team}

    def play_round(self, network: PaperTeam | None, update: int) -> tuple[Samples, Outcome]:
        """Play one match in every row, from its first tick to its last, with one policy throughout.

        A row whose match has ended waits for the others: what follows in it is not part of the round.

        Parameters
        ----------
        network
            Plays; where it is None, all units that it would play act at random.
        update
            Updates that the policy has behind it; the matches of a round depend on this number, and on those before in nothing.
        """
        env, n_games = self.env, self.env.n_games
        env.skip_to(np.full(n_games, update, np.int64))
        if self.opponent is not None:
            self.opponent.start(np.arange(n_games))
        is_playing = np.ones(n_games, np.bool_)
        ticks: list[Samples] = []
        where: list[NDArray[np.intp]] = []
        scores: list[NDArray[np.int32]] = []
        length, n_steps, n_blocked = np.zeros((3, n_games), np.int64)
        seen_share = np.zeros(n_games)
        is_won, is_captured, has_run_out = np.zeros((3, n_games), np.bool_)
        while is_playing.any():
            seen = env.observe()
            seen_share += is_playing * (seen[Team.BLUE].ground[:, : env.ruleset.side**2] != Code.HIDDEN).mean(1)
            samples, rows = self._decide(network, seen, is_playing, len(ticks), update)
            ticks.append(samples)
            where.append(rows)
            steps, blocked = self._count_steps()
            n_steps += is_playing * steps
            n_blocked += is_playing * blocked
            turn = env.step(self._orders)
            scores.append(np.where(is_playing, turn.score, 0).astype(np.int32))
            ends = is_playing & turn.has_ended
            length[ends] = turn.ticks[ends]
            is_won |= ends & (turn.winner == Team.BLUE)
            is_captured |= ends & (turn.winner == Team.BLUE) & (turn.ending == Termination.CAPTURE)
            has_run_out |= ends & (turn.ending == Termination.TICK_LIMIT)
            is_playing &= ~turn.has_ended
            if self.opponent is not None:
                self.opponent.start(np.flatnonzero(turn.has_ended))
        stream = np.array(scores, np.float64)
        settings = self._settings
        returned = credit(stream, length, settings.reward, settings.gamma, np.where(has_run_out, settings.stall, 0.0))
        whole = Samples(*(torch.cat(parts) for parts in zip(*ticks, strict=True)))
        each = np.concatenate([returned[tick, rows] for tick, rows in enumerate(where)])
        if settings.standardise == "trajectory":
            each = standardise(each, np.concatenate(where) * self._orders[Team.BLUE].shape[1] + whole.unit.numpy())
        outcome = Outcome(
            score=stream[length - 1, np.arange(n_games)], is_won=is_won, is_captured=is_captured, ticks=length,
            seen=seen_share / length, blocked=n_blocked / np.maximum(n_steps, 1),
        )  # fmt: skip
        return whole._replace(returned=torch.from_numpy(each.astype(np.float32))), outcome

    def _count_steps(self) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Return how many steps blue's units are about to take in each row, and how many of them the ground blocks."""
        orders: Any = self._orders[Team.BLUE]  # the rules take arrays where they are not compiled
        state, side = self.env.games.state, self.env.ruleset.side
        n_units = orders.shape[1]
        row, column = np.divmod(state.cell[:, :n_units].astype(np.int64), side)
        row, column = row_after(row, orders), column_after(column, orders)
        is_there = is_on_board(row, column, side)
        ground = np.take_along_axis(state.ground, np.where(is_there, row * side + column, 0), 1)
        is_step = (state.alive[:, :n_units] > 0) & (orders != Action.STAY)
        return is_step.sum(1), (is_step & ~(is_there & can_enter(ground, self._sides[0].flies))).sum(1)

    def _decide(
        self, network: PaperTeam | None, seen: dict[Team, Observations], is_playing: NDArray[np.bool_], tick: int, update: int
    ) -> tuple[Samples, NDArray[np.intp]]:
        """Write all orders of a tick; return what blue's living units of rows that play saw and did, and the row of each.

        Both sides, where the learner plays both, go through the network together: its weights are read from memory once.
        """
        views = torch.from_numpy(np.concatenate([side.look(seen[side.team], is_playing) for side in self._sides]))
        unit = torch.from_numpy(np.concatenate([side.unit for side in self._sides]))
        n = len(self._sides[0].row)
        logits = np.zeros((len(unit), N_ACTIONS), np.float32) if network is None else infer_units(network, views, unit)
        drawn = [
            side.draw(part, seen[side.team], self._orders[side.team])
            for side, part in zip(self._sides, np.split(logits, [n]), strict=False)
        ]
        if self.opponent is not None:
            self.opponent.act(seen[Team.RED], self._orders[Team.RED])
        action = torch.from_numpy(drawn[0])
        logp = torch.from_numpy(logits[:n]).log_softmax(-1).gather(1, action[:, None]).squeeze(1)
        samples = Samples(
            views=views[:n], unit=unit[:n], action=action, logp=logp, tick=torch.full((n,), tick), returned=torch.zeros(n),
            update=torch.full((n,), update),
        )  # fmt: skip
        return samples, self._sides[0].row
