"""docs/outcomes.md lists every code of every enum; codes of plugins reach the client unchanged."""

import re
from enum import IntEnum
from pathlib import Path as FilePath

import pytest

from mbf_abstract import outcomes
from mbf_abstract.geometry import Path, Pose
from mbf_abstract.goals.goal_status import GoalStatus
from mbf_abstract.goals.goal_types import MoveBaseGoal
from mbf_abstract.outcomes import (
    ExePathOutcome,
    GetPathOutcome,
    MoveBaseOutcome,
    RecoveryOutcome,
    RefinePathOutcome,
    outcome_name,
)
from mbf_abstract.plugins import ControlResult, PlanResult, RecoveryResult, RefineResult

ROOT = FilePath(__file__).resolve().parents[3]
ENUMS = {
    "get_path": GetPathOutcome,
    "exe_path": ExePathOutcome,
    "recovery": RecoveryOutcome,
    "refine_path": RefinePathOutcome,
    "move_base": MoveBaseOutcome,
}


def read_tables():
    """Rows of the doc: action -> {code: (name, made by, test)}."""
    tables = {}
    for section in (ROOT / "docs" / "outcomes.md").read_text().split("\n## ")[1:]:
        action, _, body = section.partition("\n")
        rows = re.findall(r"^\| (\d+) \| (\w+) \| (\w+) \| .* \| (\S*) ?\|$", body, re.MULTILINE)
        tables[action] = {int(code): (name, by, test) for code, name, by, test in rows}
    return tables


TABLES = read_tables()


@pytest.mark.parametrize("action", ENUMS)
def test_the_doc_lists_every_code_with_its_name(action):
    assert {code: name for code, (name, _, _) in TABLES[action].items()} == {int(m): m.name for m in ENUMS[action]}


def test_no_enum_is_missing_from_the_doc():
    assert {e for e in vars(outcomes).values() if isinstance(e, type) and issubclass(e, IntEnum)} - {IntEnum} == set(
        ENUMS.values()
    )


@pytest.mark.parametrize("action", ENUMS)
def test_the_test_that_the_doc_names_exists_and_knows_the_code(action):
    for code, (name, made_by, test) in TABLES[action].items():
        if made_by == "reserved":
            assert not test
            continue
        text = (ROOT / "tests" / "unit" / test).read_text()
        if test.endswith("test_outcomes.py") or code == 0 or action == "move_base":
            continue
        assert f"Outcome.{name}" in text, (action, code, name)


def plugin_codes(action, first, last):
    own = range(first, last)
    named = [code for code, (_, made_by, _) in TABLES[action].items() if made_by == "plugin" and code]
    return [*named, own[0], own[-1]]


@pytest.mark.parametrize("code", plugin_codes("get_path", 71, 100))
def test_a_planners_code_and_text_arrive_as_they_were_given(make_session, code):
    session = make_session(planner_max_retries=0)
    session.planner.play(PlanResult(code, "my words"))
    result = session.navigator.get_path(Pose.planar(1.0, 0.0))
    assert (result.outcome, result.message) == (code, "my words")
    assert result.outcome_name == outcome_name(code)


@pytest.mark.parametrize("code", plugin_codes("exe_path", 121, 150))
def test_a_controllers_code_and_text_arrive_as_they_were_given(make_session, code):
    session = make_session(controller_max_retries=0)
    session.controller.play(ControlResult(code, "my words"))
    result = session.navigator.exe_path(session.path_to(1.0))
    assert (result.outcome, result.message) == (code, "my words")


@pytest.mark.parametrize("code", plugin_codes("recovery", 171, 200))
def test_a_behaviours_code_and_text_arrive_as_they_were_given(make_session, code):
    session = make_session()
    session.recovery.play(RecoveryResult(code, "my words"))
    result = session.navigator.recover()
    assert (result.outcome, result.message) == (code, "my words")


@pytest.mark.parametrize("code", plugin_codes("refine_path", 221, 250))
def test_a_refiners_code_and_text_arrive_as_they_were_given(make_session, code):
    session = make_session()
    session.refiner.play(RefineResult(code, "my words"))
    result = session.navigator.refine_path(Path.from_points([(0, 0, 0), (1, 0, 0)]))
    assert (result.outcome, result.message) == (code, "my words")


@pytest.mark.parametrize("code", range(1, 10))
def test_one_to_nine_are_a_planners_own_successes(make_session, code):
    session = make_session()
    path = Path.from_points([(0, 0, 0), (1, 0, 0)])
    session.planner.play(PlanResult(code, "", path))
    result = session.navigator.get_path(Pose.planar(1.0, 0.0))
    assert result.success
    assert (result.outcome, result.outcome_name) == (code, f"SUCCESS ({code})")


def test_a_goal_for_a_server_that_is_shut_down_is_rejected_with_an_internal_error(make_session):
    session = make_session()
    session.server.close()
    handle = session.navigator.send(MoveBaseGoal(Pose.planar(1.0, 0.0)))
    assert handle.status is GoalStatus.REJECTED
    assert handle.result.outcome == MoveBaseOutcome.INTERNAL_ERROR


@pytest.mark.parametrize(
    ("code", "name"),
    [
        (56, "NO_PATH_FOUND"),
        (75, "plugin-specific GetPath code 75"),
        (66, "unknown outcome code 66"),
        (-1, "unknown outcome code -1"),
        (11, "CANCELED"),
    ],
)
def test_every_number_has_a_readable_name(code, name):
    assert outcome_name(code) == name
