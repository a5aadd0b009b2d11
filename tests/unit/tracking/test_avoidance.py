"""What sampled motions cost among moving objects: against a naive twin, and that a robot that stands costs nothing."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import ValidationError

from mbf_abstract.geometry import Pose
from mbf_abstract.maps.tracking.avoidance import LOOK, AvoidanceParameters, MovingAround
from mbf_abstract.maps.tracking.contact import SAME_STOREY
from mbf_abstract.maps.tracking.kernels.meeting import NOBODY
from mbf_abstract.maps.tracking.objects import Motion, TrackedObject
from mbf_abstract.maps.tracking.robot_box import RobotBox

DISC, CARRIER = RobotBox.disc(0.3), RobotBox(-0.35, 0.45, -0.25, 0.2, 0.05)
LIMITS = AvoidanceParameters(weight=10.0, horizon=2.0, margin=0.4)
STEP, HERE = 0.05, Pose.planar(0.0, 0.0)


def person(x, y, vx=0.0, vy=0.0, motion=Motion.MOVING, z=0.0):
    return TrackedObject(1, motion, x, y, z, vx, vy, 0.25, 5.0, 0.0, 0.0, 0.0, "map")


class Seeing:
    """A map on which these objects are known."""

    def __init__(self, box, *objects):
        self.robot_box, self.objects, self.same_storey = box, objects, SAME_STOREY

    def tracked_objects(self, now):
        return self.objects


def met(motions, *objects, box=DISC, pose=HERE, limits=LIMITS, step=STEP):
    """Encounters of motions, each (steps, 3) with absolute places."""
    relative = np.array(motions) - (pose.x, pose.y, 0.0)
    poses = np.ascontiguousarray(relative.transpose(2, 1, 0), dtype=np.float32)
    return MovingAround.on(Seeing(box, *objects), pose, 0.0, limits).meet(poses, step)


def arc(v, w=0.0, pose=(0.0, 0.0, 0.0), steps=50, step=STEP):
    """Places of a robot that drives on with a velocity."""
    x, y, yaw = pose
    places = []
    for _ in range(steps):
        x, y, yaw = x + v * step * math.cos(yaw), y + v * step * math.sin(yaw), yaw + w * step
        places.append((x, y, yaw))
    return places


def naive(motion, objects, box, pose, limits, step):
    """Cost and contact of one motion, look by look."""
    worst, touched = 0.0, NOBODY
    stride = max(1, round(LOOK / step))
    for t in range(stride - 1, len(motion), stride):
        time = (t + 1) * step
        for k, known in enumerate(known for known in objects if known.motion is Motion.MOVING):
            if time >= limits.horizon:
                continue
            place = np.array([[known.position_in(time)]])
            there, here = (
                float(box.gaps(np.array([at]), place, np.array([known.radius]))[0, 0])
                for at in (motion[t], (pose.x, pose.y, pose.yaw))
            )
            near, staying = (min(1.0, max(0.0, 1.0 - gap / limits.margin)) for gap in (there, here))
            worst = max(worst, (1.0 - time / limits.horizon) * (near - staying))
            touched = k if touched == NOBODY and there < 0.0 <= here else touched
    return limits.weight * worst, touched


speeds, places = st.floats(-1.0, 1.0), st.floats(-2.0, 2.0)
people = st.lists(
    st.builds(person, places, places, speeds, speeds, st.sampled_from([Motion.MOVING, Motion.MOVING, Motion.PARKED])),
    max_size=4,
)


@given(
    people,
    st.lists(st.tuples(speeds, speeds), min_size=1, max_size=5),
    st.floats(-3.0, 3.0),
    st.sampled_from([0.03, 0.05, 0.1, 0.2, 0.5, 1.0]),
)
@settings(max_examples=150, deadline=None)
def test_motions_cost_what_the_naive_twin_finds(objects, velocities, yaw, step):
    pose = Pose.planar(0.3, -0.2, yaw)
    motions = [arc(v, w, (pose.x, pose.y, yaw), 20, step) for v, w in velocities]
    for box in (DISC, CARRIER):
        found = met(motions, *objects, box=box, pose=pose, step=step)
        expected = [naive(motion, objects, box, pose, LIMITS, step) for motion in motions]
        assert found.costs == pytest.approx([cost for cost, _ in expected], abs=1e-4)
        near_contact = [min_gap < 1e-5 for min_gap in (_least_gap(m, objects, box, pose, step) for m in motions)]
        for one, (_, touched), close in zip(found.touched, expected, near_contact, strict=True):
            assert one == touched or close


@pytest.mark.parametrize(
    ("box", "towards"),
    [(RobotBox(-0.1, 1.2, -0.2, 0.2, 0.0), (1.0, 0.0)), (RobotBox(-0.2, 0.2, -0.1, 1.2, 0.0), (0.0, 1.0))],
    ids=["long", "wide"],
)
def test_an_outline_that_reaches_far_to_one_side_meets_who_is_there(box, towards):
    stands_there = person(1.75 * towards[0], 1.75 * towards[1])
    motion = [(0.02 * step * towards[0], 0.02 * step * towards[1], 0.0) for step in range(1, 21)]
    cost, touched = naive(motion, [stands_there], box, HERE, LIMITS, STEP)
    found = met([motion], stands_there, box=box)
    assert cost > 1.0 and touched == 0
    assert (found.costs[0], found.touched[0]) == (pytest.approx(cost, abs=1e-4), touched)


def _least_gap(motion, objects, box, pose, step):
    """Least distance [m] of any gap, that of the standing robot included, from contact: rounding decides below."""
    least = math.inf
    for t, at in enumerate(motion):
        for known in objects:
            place = np.array([[known.position_in((t + 1) * step)]])
            for robot in (at, (pose.x, pose.y, pose.yaw)):
                gap = box.gaps(np.array([robot]), place, np.array([known.radius]))[0, 0]
                least = min(least, abs(float(gap)))
    return least


@given(people, st.floats(-3.0, 3.0))
@settings(max_examples=50, deadline=None)
def test_a_robot_that_stands_is_never_at_fault(objects, yaw):
    pose = Pose.planar(0.0, 0.0, yaw)
    stands = [(0.0, 0.0, yaw)] * 40
    for box in (DISC, CARRIER):
        found = met([stands], *objects, box=box, pose=pose)
        assert found.costs[0] == pytest.approx(0.0, abs=1e-4)
        assert not found.touches[0] or _least_gap(stands, objects, box, pose, STEP) < 1e-5


def test_who_crosses_is_let_by():
    crossing = person(1.2, -1.2, 0.0, 1.0)
    on, slower = met([arc(0.9), arc(0.1)], crossing).costs
    assert on > 3.0
    assert slower == 0.0


def test_getting_out_of_the_way_of_who_comes_costs_nothing():
    towards = person(1.5, 0.1, -0.8)
    aside, on = met([arc(0.5, -1.5), arc(0.5)], towards)[0]
    back = met([arc(-0.5)], towards).costs[0]
    assert back == 0.0 and on > 5.0 and aside < on


def test_whom_the_best_motion_would_meet_first_hinders_the_robot():
    near, far = replace(person(1.2, 0.0, -0.3), number=4), replace(person(2.0, 0.0, -0.3), number=9)
    motions = np.array([arc(0.8), arc(0.0)], dtype=np.float32)
    around = MovingAround.on(Seeing(DISC, far, near), HERE, 0.0, LIMITS)
    found = around.meet(np.ascontiguousarray(motions.transpose(2, 1, 0)), STEP)
    assert around.hindering(found, np.array([1.0, 2.0])) == "object 4 moves in the way, at (1.20, 0.00)"
    assert around.hindering(found, np.array([2.0, 1.0])) == "", "it would stand anyway"


def test_who_is_met_after_the_horizon_does_not_count_however_long_the_motion():
    late, on = person(4.2, 0.0), [arc(1.6, steps=60)]
    assert not met(on, late, limits=replace_limits(horizon=2.0)).touches.any()
    assert met(on, late, limits=replace_limits(horizon=3.0)).touches.all()


def test_the_sooner_a_contact_the_more_it_costs():
    near, far = (met([arc(0.8)], person(x, 0.0)).costs[0] for x in (0.9, 1.8))
    assert near > far > 0.0
    assert met([arc(0.8)], person(5.0, 0.0)).costs[0] == 0.0, "beyond the horizon"


@pytest.mark.parametrize("motion", [Motion.WAITING, Motion.PARKED])
def test_what_stands_is_the_business_of_the_map(motion):
    assert not met([arc(0.8)], person(0.8, 0.0, motion=motion)).costs.any()


def test_who_is_on_another_storey_is_not_met():
    assert met([arc(0.8)], person(0.8, 0.0)).touches.all()
    assert not met([arc(0.8)], person(0.8, 0.0, z=3.0)).touches.any()


def test_without_anybody_or_weight_nothing_costs_anything():
    off = replace_limits(weight=0.0)
    for found in (met([arc(0.8)]), met([arc(0.8)], person(0.8, 0.0), limits=off)):
        assert found.costs.dtype == np.float32 and not found.costs.any() and not found.touches.any()


def test_the_order_of_the_objects_does_not_matter():
    crowd = [replace(person(0.3 * k, 1.0 - 0.2 * k, -0.4, 0.1 * k), number=k) for k in range(6)]
    motions = [arc(v, w) for v in (0.2, 0.8) for w in (-1.0, 0.0, 1.0)]
    assert np.array_equal(met(motions, *crowd).costs, met(motions, *reversed(crowd)).costs)


@pytest.mark.parametrize(("name", "value"), [("weight", -1.0), ("horizon", 0.0), ("margin", 0.0), ("margin", math.nan)])
def test_what_makes_no_sense_is_refused(name, value):
    with pytest.raises(ValidationError, match=name):
        replace_limits(**{name: value})


def replace_limits(**changes):
    return AvoidanceParameters(**{**LIMITS.model_dump(), **changes})


def test_a_robot_that_cannot_get_on_waits_for_the_nearest_who_moves():
    far, near = person(2.0, 0.0, 0.0, 0.5), replace(person(0.0, -1.2, 0.5, 0.0), number=7)
    around = MovingAround.on(Seeing(DISC, far, near), HERE, 0.0, LIMITS)
    assert around.nearest(1.5) == "object 7 moves in the way, at (0.00, -1.20)"
    assert around.nearest(0.5) == "" == MovingAround.on(Seeing(DISC), HERE, 0.0, LIMITS).nearest(1.5)
