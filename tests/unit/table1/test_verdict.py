"""The six criteria and what is made of them."""

import pytest

from terrain.experiments.table1.statistics import compare
from terrain.experiments.table1.verdict import judge, verdict


def judged(a, b):
    """Return the criteria that hold, as letters, and the verdict."""
    criteria = judge(a, b)
    letters = "".join(letter for letter, each in zip("pcrmts", criteria, strict=True) if each.holds)
    return letters, verdict(criteria, compare(a, b)["planner calls"].value)


@pytest.fixture
def runs(tally):
    """Ten runs of each condition that agree with the paper, with changes to condition B."""

    def make(**changes):
        a = [tally(planner=120 + seed, controller=40, clear=18, other=2, time=480.0 + seed) for seed in range(10)]
        like_the_paper = {"planner": 29, "controller": 24, "clear": 9, "other": 9, "time": 420.0}
        return a, [tally(**{**like_the_paper, **changes}) for _ in range(10)]

    return make


def test_numbers_like_the_papers_are_reproduced_with_strong_agreement(runs):
    a, b = runs()
    assert judged(a, b) == ("pcrmts", "reproduced")
    assert all(criterion.strong for criterion in judge(a, b))


# what is changed in condition B                                          what still holds   verdict
@pytest.mark.parametrize(
    ("changes", "holds", "expected"),
    [
        ({"planner": 70}, "crmts", "not reproduced"),  # ratio below 2
        ({"controller": 45}, "prmts", "partly reproduced"),
        ({"clear": 3, "other": 3}, "pcmts", "partly reproduced"),  # ratio of recoveries 3.3
        ({"clear": 20, "other": 0}, "pcrts", "not reproduced"),  # one sort only: no mix
        ({"time": 490.0}, "pcrms", "partly reproduced"),
        ({"contacts": 1}, "pcrmt", "not reproduced"),  # ten contacts more
        ({"lost": 1}, "pcrmt", "not reproduced"),
    ],
)
def test_each_criterion_can_fail_by_itself(runs, changes, holds, expected):
    assert judged(*runs(**changes)) == (holds, expected)


def test_one_contact_more_than_condition_a_is_allowed_and_two_are_not(runs, tally):
    a, b = runs()
    for extra, holds in ((1, True), (2, False)):
        touched = tally(planner=29, controller=24, clear=9, other=9, time=420.0, contacts=extra)
        assert judge(a, [*b[:-1], touched])[-1].holds is holds


def test_a_ratio_that_one_seed_makes_does_not_hold(runs, tally):
    _, b = runs()
    a = [tally(planner=20, controller=40, clear=18, other=2, time=480.0) for _ in range(9)]
    a.append(tally(planner=600, controller=40, clear=18, other=2, time=480.0))
    assert sum(t.all_planner_calls for t in a) / sum(t.all_planner_calls for t in b) > 2.0
    assert not judge(a, b)[0].holds
