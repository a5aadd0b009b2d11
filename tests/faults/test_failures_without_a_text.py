"""Fault table, row 39: a plugin of any kind fails and gives no reason.

The goal's text then names the plugin and the outcome.
"""

import pytest

from mbf_abstract.geometry import Pose
from mbf_abstract.goals.goal_types import ExePathGoal, GetPathGoal, RecoveryGoal, RefinePathGoal
from mbf_abstract.outcomes import ExePathOutcome, GetPathOutcome, RecoveryOutcome, RefinePathOutcome
from mbf_abstract.plugins import ControlResult, PlanResult, RecoveryResult, RefineResult
from mbf_abstract.testing.scripted_session import ScriptedSession

# kind        answer, without a text                            name of its outcome
SILENT = {
    "planner": (PlanResult(GetPathOutcome.NO_PATH_FOUND), "NO_PATH_FOUND"),
    "controller": (ControlResult(ExePathOutcome.BLOCKED_PATH), "BLOCKED_PATH"),
    "recovery": (RecoveryResult(RecoveryOutcome.IMPASSABLE), "IMPASSABLE"),
    "refiner": (RefineResult(RefinePathOutcome.FAILURE), "FAILURE"),
}


def goal_of(session, kind):
    goals = {
        "planner": lambda: GetPathGoal(Pose.planar(3.0, 0.0)),
        "controller": lambda: ExePathGoal(session.path_to(3.0)),
        "recovery": RecoveryGoal,
        "refiner": lambda: RefinePathGoal(session.path_to(3.0)),
    }
    return goals[kind]()


@pytest.mark.parametrize("kind", SILENT)
def test_a_failure_without_a_text_names_plugin_and_outcome(kind):
    answer, outcome = SILENT[kind]
    with ScriptedSession(planner_max_retries=0, controller_max_retries=0) as session:
        getattr(session, kind).play(answer)
        result = session.navigator.send(goal_of(session, kind)).wait()
    assert result.outcome == answer.outcome
    assert result.message == f"plugin '{kind}' failed with {outcome} and gave no reason"
    assert answer.message == "", "the plugin may keep its answer"
