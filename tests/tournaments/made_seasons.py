"""Seasons that nobody played, as they stand in a store: of any size, written at once."""

import json
import random
from collections import Counter
from collections.abc import Sequence
from typing import Any

from sqlalchemy import insert

from tournaments.league.season import Phase
from tournaments.ratings.rate import Rating
from tournaments.ratings.standings import Record, Standing
from tournaments.reports.season_table import describe_season
from tournaments.store.schema import MATCHES, VERSIONS
from tournaments.store.season_store import SeasonStore
from tournaments.store.store import StoredLeague

DEFINITION = {"ruleset": "paper", "rules": "1", "entries": {}, "clock": {}, "season": {}, "secret": "s"}
_SEATS = json.dumps({side: {"faults": {}, "latency_p50_s": 0.001, "latency_p99_s": 0.003} for side in ("blue", "red")})
_CHUNK = 10_000


def make_season(store: SeasonStore, owners: dict[str, str], n_versions: int = 1, name: str = "course") -> StoredLeague:
    """Return a season with the versions of these entries, each rated but the last, which plays."""
    league = store.open_season(name, DEFINITION, 1.0)
    rows = []
    for entry in owners:
        for number in range(1, n_versions + 1):
            rating = {"elo": 10.0 * number, "elo_low": 10.0 * number - 60, "elo_high": 10.0 * number + 60, "matches": 40}
            rows.append(
                {
                    "league_id": league.id, "entry": entry, "number": number, "fingerprint": f"{entry}'s code {number}",
                    "entered_at": 86_400.0 * number, "spec": f"{entry}/{number}/bot.py",
                    "rating": json.dumps(rating) if number < n_versions else None,
                }
            )  # fmt: skip

    def enter(connection: Any) -> None:
        connection.execute(insert(VERSIONS), rows)
        for entry, owner in owners.items():
            store._play_version(connection, league.id, entry, owner, n_versions)
        store._redefine(connection, league)

    store._do("write to", enter, name)
    return store.get(name)


def play_pairs(store: SeasonStore, league: StoredLeague, labels: Sequence[str], n_pairs: int, seed: int = 1) -> None:
    """Write pairs of matches between any two of these labels, whoever won."""
    rng, n_played = random.Random(seed), Counter[tuple[str, str]]()
    rows: list[dict[str, Any]] = []
    for _ in range(n_pairs):
        one, other = sorted(rng.sample(labels, 2))
        n_played[one, other] += 1
        for blue, red in ((one, other), (other, one)):
            identity = f"{league.name}/{one}/{other}/{10_000 * seed + n_played[one, other]}/{blue}-blue/0"
            winner = rng.choice(["blue", "red", None])
            rows.append(
                {
                    "league_id": league.id, "identity": identity, "blue": blue, "red": red, "reason": "", "seats": _SEATS,
                    "ending": "capture" if winner else "tick_limit", "winner": winner, "score": 0, "ticks": 50,
                }
            )  # fmt: skip
    for first in range(0, len(rows), _CHUNK):
        chunk = rows[first : first + _CHUNK]
        store._do("write to", lambda connection, chunk=chunk: connection.execute(insert(MATCHES), chunk), league.name)


def keep_table(store: SeasonStore, league: StoredLeague, *, phase: str = "open", **more: Any) -> None:
    """Keep a table of the versions that play, the first by name first."""
    rows = [
        Standing(
            name=label,
            rating=Rating(elo=100.0 - rank, elo_low=50.0 - rank, elo_high=150.0 - rank, rank=rank, rank_low=rank, rank_high=rank),
            record=Record(wins=4, draws=2, losses=2),
            faults={},
            forfeits=0,
            latency=None,
        )
        for rank, label in enumerate(league.definition["entries"], 1)
    ]
    given = {"deadline_s": None, "n_matches": store.count(league), "n_waiting": 0, "n_playing": 2, "now_s": 7.0, **more}
    store.put_standings(league, describe_season(league.name, rows, phase=Phase(phase), **given), given["now_s"])


def submit(store: SeasonStore, league: StoredLeague, entry: str, owner: str, says: str = "", *, digest: str = "d") -> None:
    """Submit something; it waits for its check, or is refused with a sentence."""
    given = store.submit(league, entry=entry, owner=owner, digest=digest, n_bytes=700, now_s=2.0)
    if says:
        store.refuse(league, given, says, {"text": [f"{entry}: 700 bytes", says]})
