"""What an author hears of a policy in a pit: late turns, and why units stayed. A real match rules."""

from collections import deque
from typing import Any

from arena.game.keys import MatchKeys
from arena.game.ruleset import load, rules_values
from arena.game.types import Team
from arena.match.effects import Ask
from arena.match.match import Match
from arena.match.time_control import TimeControl
from arena.protocol.messages import Orders, Ticket, Turn
from arena.records.journal import Header
from clients.feedback import Feedback
from clients.seat import Seat
from policies.each_seat import EachSeatFactory

RULES = load("paper").with_({"side": 10, "tick_limit": 30})
THINKS_S = {4: 1.5, 6: 1.21, 8: 0.9}
"""By tick, of a bot that has 1 s for each and 0.6 s in the bank."""
FORGETS = (2, 3, 12)
"""Ticks at which it answers one order too few."""


def play(feedback: Feedback) -> tuple[list[str], Seat]:
    """Play blue's bot against one that stays, on a clock that its thinking moves; return what was said tick by tick."""
    now_s = 0.0

    class Bot:
        def act(self, observation: Any) -> list[int]:
            nonlocal now_s
            now_s += THINKS_S.get(observation.tick, 0.0)
            return [0] * (len(observation.units) - (observation.tick in FORGETS))

    time_control = TimeControl(turn_time_s=1.0, bank_s=0.6)
    keys = MatchKeys(map_key=bytes(32), match_key=bytes(32))
    match = Match(Header(identity="m", blue="bot", red="ann", ruleset=RULES, keys=keys), time_control, now_s)
    ticket = Ticket(
        match="m", lane=0, team=int(Team.BLUE), ruleset=rules_values(RULES), opponent="ann", turn_time_s=1.0, bank_s=0.6, tick=0,
        secret=bytes(32), commitment=b"",
    )  # fmt: skip
    seat = Seat(ticket, bytes(32), EachSeatFactory(Bot), clock=lambda: now_s)
    said: list[str] = []
    feedback.begin(seat)
    seat.listen()
    effects = deque([*match.ready(Team.BLUE, now_s), *match.ready(Team.RED, now_s)])
    while effects and match.tick < 20:
        effect = effects.popleft()
        if isinstance(effect, Ask) and effect.team is Team.RED:
            effects += match.submit(Team.RED, effect.tick, bytes(6), now_s)
        elif isinstance(effect, Ask):
            effects += match.submit(Team.RED, effect.tick, bytes(6), now_s)
            turn = Turn(tick=effect.tick, observation=effect.observation, charged_us=effect.charged_us)
            answers = seat.receive(turn)
            effects += match.advance(now_s)
            for answer in answers:
                assert isinstance(answer, Orders)
                effects += match.submit(Team.BLUE, answer.tick, answer.actions, now_s)
        said += feedback.news()
    return said, seat


def test_late_turns_are_told_as_the_pit_charges_them_and_refusals_once() -> None:
    feedback = Feedback()

    said, seat = play(feedback)

    assert said == [
        "match m: tick 2: 5 orders for 6 units; all its units stay",
        "match m: tick 4 took 1,500 ms of 1,000 and 600 in the bank, which paid",
        "match m: tick 6 was late: 1,210 ms of 1,000 and 100 in the bank; all its units stayed",
    ]
    assert feedback.end(seat) == (
        [
            "tick 2: 5 orders for 6 units; all its units stay (3 turns)",
            "1 turn late, the worst 1,210 ms, at tick 6",
            "1 turn paid by the bank, which has 0 ms left",
        ],
        "",
    )


def test_in_the_next_match_a_kind_that_was_told_is_only_counted() -> None:
    feedback = Feedback()
    _, first = play(feedback)
    counted = feedback.end(first)

    said, second = play(feedback)

    assert len(said) == 2
    assert not any("orders" in sentence for sentence in said)
    assert feedback.end(second) == counted
