"""The bench of the ladder, small: real processes that are killed and started at random."""

from benchmarks.ladder import measure
from benchmarks.measuring.ladder_order import N_MATCHES, measure_order


def test_a_ladder_outlives_entries_that_come_and_go() -> None:
    figures = measure(lambda _: None, duration_s=4.0, n_entries=5, kill_every_s=0.8)

    assert figures["kills"] > 0
    assert figures["matches"] > 0
    assert figures["matches_counted"] == figures["matches"]
    assert figures["journals_that_fail"] == 0
    assert figures["voids"] == 0
    assert figures["wait_most_s"] >= figures["wait_p50_s"] >= 0
    assert set(figures["mean_mu"]) <= {"random", "patrol", "roomba", "fighter", "rush"}


def test_the_order_of_a_ladder_is_compared_with_a_round_robin_of_the_same_entries() -> None:
    figures = measure_order(
        lambda _: None, shipped=("random", "patrol", "rush"), scripts=("rush",), lost=(0.0, 0.9), n_pairs=2, n_times=2
    )

    assert [figures[field]["matches_of_the_round_robin"] for field in ("shipped", "course")] == [3 * 4, 4]
    for way in ("ladder", "season", "chance"):
        for n_matches in N_MATCHES:
            found = figures["shipped"][f"{way}_{n_matches}"]
            assert found["spearman"]["mean"] > 0.7  # rush over patrol over random
            assert -1 <= found["kendall"]["low"] <= found["kendall"]["mean"] <= found["kendall"]["high"] <= 1
