"""The bench of the ladder, small: real processes that are killed and started at random."""

from benchmarks.ladder import measure


def test_a_ladder_outlives_entries_that_come_and_go() -> None:
    figures = measure(lambda _: None, duration_s=4.0, n_entries=5, kill_every_s=0.8)

    assert figures["kills"] > 0
    assert figures["matches"] > 0
    assert figures["matches_counted"] == figures["matches"]
    assert figures["journals_that_fail"] == 0
    assert figures["voids"] == 0
    assert figures["wait_most_s"] >= figures["wait_p50_s"] >= 0
    assert set(figures["mean_mu"]) <= {"random", "patrol", "roomba", "fighter", "rush"}
