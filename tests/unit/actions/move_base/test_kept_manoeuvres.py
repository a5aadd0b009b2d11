"""move_base: a robot in a manoeuvre does not take over another one that is no shorter."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from mbf_abstract.actions.manoeuvre_kept import goes_on, rest_of
from mbf_abstract.events import EventKind
from mbf_abstract.geometry import Path, Pose
from mbf_abstract.testing.scripted import straight_plan


def along(*corners, step=0.1):
    """A path along x by corners [m], driven with the heading 0."""
    parts = [np.arange(a, b, np.copysign(step, b - a)) for a, b in pairwise(corners)]
    return Path.from_poses([Pose.planar(float(x), 0.0) for x in [*np.concatenate(parts), corners[-1]]])


@pytest.mark.parametrize(
    ("old", "to_go", "new", "keeps"),
    [
        (along(0, 1, -2), 3.5, along(0.5, 0.2, 4), True),  # it goes on to its cusp, 0.5 m ahead
        (along(0, 1, -2), 3.5, along(0.5, 1, -1.9), False),  # shorter
        (along(0, 1, -2), 2.5, along(0.5, 3.5), True),  # behind the cusp, and the new one goes ahead
        (along(0, 1, -2), 2.5, along(0.5, 0, 4), True),  # behind the cusp, and the new one has another one soon
        (along(0, 1, -2), 2.5, along(0.5, -2.5), False),  # behind the cusp, in the same gear
        (along(0, 4, 3.5), 4.4, along(0.1, 4, 3.4), False),  # the cusp is far
        (along(0, 4), 3.9, along(0.1, -0.2, 4), True),
        (along(0, 4), 0.0, along(4, 5), False),
    ],
)
def test_a_manoeuvre_is_kept_while_it_is_no_longer_than_the_new_one(old, to_go, new, keeps):
    assert goes_on(old, to_go, new) == keeps


def test_what_is_left_begins_at_a_pose_of_the_path():
    assert rest_of(along(0, 1, -2), 2.45).positions[:, 0] == pytest.approx(along(0.4, -2).positions[:, 0])


def plans_in_turn(session, detour):
    """Every second plan begins with a stroke backward [m]."""
    count = 0

    def plan(request):
        nonlocal count
        count += 1
        straight = straight_plan(request)
        if count % 2:
            return straight
        x = request.start.x
        return replace(straight, path=along(x, x - detour, request.goal.x))

    session.planner.play(plan)


def test_a_robot_does_not_change_gear_for_a_longer_plan(make_session):
    session = make_session(planner_frequency=2.0)
    plans_in_turn(session, 0.3)
    assert session.send(2.0).wait().success
    assert all(command.vx >= 0.0 for _, command in session.robot.commands)
    kept = [event.data["kept"] for event in session.recorded(EventKind.STATE_CHANGED) if "kept" in event.data]
    assert kept and "m of a manoeuvre are left" in kept[0]


@pytest.mark.parametrize("answer", ["pose 3 of the path is blocked", RuntimeError("no tile")])
def test_it_does_where_the_way_it_was_on_is_blocked_or_the_map_cannot_say(make_session, monkeypatch, answer):
    def obstacle_along(path):
        if isinstance(answer, Exception):
            raise answer
        return answer

    session = make_session(planner_frequency=2.0)
    plans_in_turn(session, 0.3)
    monkeypatch.setattr(session.server, "obstacle_along", obstacle_along)
    session.send(2.0)
    session.clock.sleep(0.9)
    assert len(session.controller.paths) == session.plans == 2
