import re

import pytest

from arena.errors import InputError
from policies.registry import check_name, load, without_settings
from policies.search.planner import LEAST_BUDGET, Planner, PlannerFast


def test_a_number_behind_a_planners_name_is_its_budget() -> None:
    planner = load("planner-fast:2000")

    assert isinstance(planner, type)
    assert issubclass(planner, PlannerFast)
    assert planner.budget == 2000
    assert PlannerFast.budget != 2000, "the one that ships is as it was"


def test_settings_change_what_they_name_and_nothing_else() -> None:
    planner = Planner.with_settings("budget=500,hold=7,is_sure=1.5,tries_goals=false")

    effort = planner.effort_of(planner.budget)
    assert effort == Planner.effort_of(500)._replace(hold=7, is_sure=1.5, tries_goals=False)


@pytest.mark.parametrize(
    ("spec", "says"),
    [
        (f"planner:{LEAST_BUDGET - 1}", f"{LEAST_BUDGET} is the least"),
        ("planner:0", "budget is '0'; it must be a whole number from 1 on"),
        ("planner:-5", "budget is '-5'"),
        ("planner:", "budget is ''"),
        ("planner:few=0", "few is '0'; it must be a whole number from 1 on"),
        ("planner:is_sure=nan", "is_sure is 'nan'; it must be a number from 0 on"),
        ("planner:filters=maybe", "filters is 'maybe'; it must be true or false, as in filters=true"),
        ("planner:holt=3", "did you mean 'hold'?"),
        ("role_team:3", "role_team has no settings; leave out :3"),
    ],
)
def test_what_cannot_be_set_is_said_in_one_sentence(spec: str, says: str) -> None:
    with pytest.raises(InputError, match=re.escape(says)):
        check_name(spec)


def test_only_our_own_fighters_have_settings() -> None:
    assert without_settings("planner:budget=3") == "planner"
    assert without_settings("exec:python3 bot.py") == "exec:python3 bot.py"
