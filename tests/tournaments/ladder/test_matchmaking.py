"""Who meets whom on a ladder, by ratings and waits."""

from hypothesis import given
from hypothesis import strategies as st

from tournaments.ladder.matchmaking import AGAIN, NEAR, WIDEN_PER_S, Candidate, choose

crowds = st.lists(st.builds(Candidate, mu=st.floats(-50, 100), since_s=st.floats(0, 100)), min_size=2, max_size=12)


def candidate(
    mu: float, since_s: float = 0.0, last: int | None = None, owner: str = "", n_met: dict[int, int] | None = None
) -> Candidate:
    return Candidate(mu=mu, since_s=since_s, last=last, owner=owner, n_met=n_met or {})


def wait_until_met(*candidates: Candidate) -> tuple[float, tuple[int, int]]:
    """Return after how many tenths of a second two meet, and who."""
    for tenths in range(1_000):
        chosen = choose(candidates, tenths / 10)
        if chosen is not None:
            return tenths / 10, chosen
    raise AssertionError("nobody ever meets")


def test_nobody_meets_where_nobody_else_waits() -> None:
    assert choose([], 9.0) is None
    assert choose([candidate(25)], 1e9) is None


def test_two_of_like_rating_meet_at_once() -> None:
    assert choose([candidate(25), candidate(25 + NEAR)], 0.0) == (0, 1)


def test_the_nearest_rating_is_chosen() -> None:
    assert choose([candidate(25), candidate(29), candidate(23), candidate(28)], 0.0) == (0, 2)


def test_among_those_that_are_near_enough_the_one_that_was_met_least_is_chosen() -> None:
    met = {1: 2, 2: 3, 3: 1, 4: 0}

    assert choose([candidate(25, n_met=met), candidate(29), candidate(23), candidate(37), candidate(41)], 0.0) == (0, 3)


def test_two_of_one_owner_never_meet() -> None:
    alone = [candidate(25, owner="eve", last=1), candidate(25, owner="eve", last=0)]

    assert choose(alone, 1e9) is None
    assert choose([*alone, candidate(90)], 1e9) in ((0, 2), (1, 2))


def test_a_rematch_that_is_the_only_match_of_two_owners_is_played() -> None:
    """Two of one owner wait, and whom both met last: there is nothing else to wait for."""
    eves = [candidate(25, owner="eve", last=2), candidate(25, owner="eve", last=2)]

    assert wait_until_met(*eves, candidate(25, last=1))[0] <= AGAIN / WIDEN_PER_S


def test_waiting_widens_the_difference_that_is_accepted() -> None:
    gap = NEAR + 3.0 * WIDEN_PER_S

    waited_s, chosen = wait_until_met(candidate(0), candidate(gap))

    assert (waited_s, set(chosen)) == (3.0, {0, 1})


def test_whoever_has_waited_longest_chooses_first_and_is_not_passed_over_for_better_matches() -> None:
    old, young = candidate(0, since_s=0.0), (candidate(60, since_s=20.0), candidate(60, since_s=20.0))

    assert choose([young[0], old, young[1]], 20.0) in ((1, 0), (1, 2))


def test_the_same_two_do_not_meet_twice_in_a_row_while_others_wait() -> None:
    waited_s, chosen = wait_until_met(candidate(25, last=1), candidate(25, last=0), candidate(43))

    assert 2 in chosen
    assert waited_s > 0


def test_a_rematch_of_one_side_is_one_too() -> None:
    assert wait_until_met(candidate(25, last=1), candidate(25), candidate(43))[1] == (0, 2)


def test_the_same_two_meet_again_after_a_while_where_nobody_else_waits() -> None:
    waited_s, chosen = wait_until_met(candidate(25, last=1), candidate(25, last=0))

    assert set(chosen) == {0, 1}
    assert 0 < waited_s <= AGAIN / WIDEN_PER_S


def test_three_that_all_met_last_still_meet() -> None:
    assert wait_until_met(candidate(25, last=1), candidate(25, last=2), candidate(25, last=0))[0] <= AGAIN / WIDEN_PER_S


@given(crowds, st.data())
def test_nobody_waits_for_ever_while_somebody_else_is_free(crowd: list[Candidate], data: st.DataObject) -> None:
    indices = st.none() | st.integers(0, len(crowd) - 1)
    crowd = [candidate(one.mu, one.since_s, last=data.draw(indices.filter(lambda last, own=own: last != own)))
             for own, one in enumerate(crowd)]  # fmt: skip
    longest_s = (AGAIN + 150) / WIDEN_PER_S

    chosen = choose(crowd, 100 + longest_s)

    assert chosen is not None
    one, other = chosen
    assert one != other


@given(crowds)
def test_the_one_who_has_waited_longest_is_served_once_its_time_has_come(crowd: list[Candidate]) -> None:
    longest_s = 150 / WIDEN_PER_S

    chosen = choose(crowd, 100 + longest_s)

    assert chosen is not None
    assert crowd[chosen[0]].since_s == min(one.since_s for one in crowd)
