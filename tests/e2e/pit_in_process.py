"""A pit and its clients in this process, with Zenoh between them."""

import threading
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

from arena.errors import LostPitError
from arena.game.ruleset import Ruleset
from arena.match.time_control import TimeControl
from arena.network.session import open_router
from arena.pit.effects import MatchEnded
from arena.pit.match_session import PitContext
from arena.pit.referee import Referee
from arena.pit.seating import PlannedSeating
from arena.policy import BatchFactory
from arena.protocol.identity import Identity
from arena.records.plan import MatchPlan
from clients.runner import Runner
from clients.settings import ClientSettings
from policies import registry

PATIENCE_S = 100.0


def play_on_the_network(
    ruleset: Ruleset,
    wanted: list[MatchPlan],
    port: int,
    folder: Path,
    n_slots: int,
    *,
    turn_time_s: float | None = None,
    load: Callable[[str], BatchFactory] = registry.load,
) -> list[MatchEnded]:
    """Play plans over Zenoh: the referee in this thread, each entry's client in one of its own."""
    played: list[MatchEnded] = []
    given_up = threading.Event()
    timer = threading.Timer(PATIENCE_S, given_up.set)
    timer.start()
    with open_router(f"tcp/127.0.0.1:{port}", "pit") as session:
        seating = PlannedSeating(wanted)
        context = PitContext(pit="pit", identity=Identity.make())
        time_control = TimeControl(turn_time_s=turn_time_s, grace_s=PATIENCE_S)
        referee = Referee(session, context, ruleset, seating, time_control, folder, on_end=played.append)
        names = sorted({name for plan in wanted for name in (plan.blue, plan.red)})
        runners = [
            Runner(
                ClientSettings(
                    endpoint=f"tcp/127.0.0.1:{port}",
                    pit="pit",
                    name=name,
                    team="any",
                    make=load(name),
                    n_matches=None,
                    n_slots=n_slots,
                    patience_s=5.0,
                ),
                on_seat=lambda _: None,
                on_end=lambda _: None,
                on_wait=lambda _: None,
            )
            for name in names
        ]

        def run(runner: Runner) -> None:
            with suppress(LostPitError):  # the pit closes when the last match is over
                runner.run()

        threads = [threading.Thread(target=run, args=(runner,)) for runner in runners]
        for thread in threads:
            thread.start()
        referee.run(lambda: given_up.is_set() or len(played) == len(wanted))
        referee.close()
        for runner in runners:
            runner.stop()
        for thread in threads:
            thread.join(PATIENCE_S)
    timer.cancel()
    return played
