"""What is kept of a season's table, and what the web page makes of it."""

import json

from tournaments.league.season import Phase
from tournaments.ratings.rate import Rating
from tournaments.ratings.standings import Record, Standing
from tournaments.reports.season_table import as_season_table, describe_season


def standing(label: str, rank: int, **more: int) -> Standing:
    return Standing(
        name=label,
        rating=Rating(elo=12.34, elo_low=-87.66, elo_high=112.34, rank=rank, rank_low=rank, rank_high=rank + 1),
        record=Record(wins=3, draws=2, losses=1),
        faults={},
        forfeits=more.get("forfeits", 0),
        latency=None,
    )


def test_a_season_is_described_as_json_holds_it_and_the_page_shows_entries_and_their_versions() -> None:
    document = describe_season(
        "course", [standing("ann.2", 1, forfeits=1), standing("bob", 2)], phase=Phase.OPEN, deadline_s=86_400.0,
        new={"bob"}, n_matches=40, n_waiting=3, n_playing=2, now_s=7.0,
    )  # fmt: skip
    kept = json.loads(json.dumps(document))

    assert kept == document
    assert {key: value for key, value in kept.items() if key != "rows"} == {
        "season": "course", "phase": "open", "deadline": "1970-01-02T00:00:00+00:00",
        "matches": 40, "waiting": 3, "playing": 2, "made_at": 7.0,
    }  # fmt: skip
    ann, bob = kept["rows"]
    assert (ann["entry"], ann["version"], ann["label"], ann["is_new"]) == ("ann", 2, "ann.2", False)
    assert (bob["entry"], bob["version"], bob["label"], bob["is_new"]) == ("bob", 1, "bob", True)
    table = as_season_table(kept["rows"])
    names = [column["name"] for column in table["columns"]]
    cells = dict(zip(names, (cell["text"] for cell in table["rows"][0]), strict=True))
    assert cells == {
        "rank": "1 to 2", "entry": "ann", "version": 2, "Elo": "+12", "95% interval": "-88 to +112", "score": "0.667",
        "wins": 3, "draws": 2, "losses": 1, "forfeits": 1,
    }  # fmt: skip


def test_a_season_without_entries_has_a_table_without_rows() -> None:
    assert as_season_table([])["rows"] == []
