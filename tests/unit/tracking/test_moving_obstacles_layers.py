"""The layers of both maps: predictions, trails, clearing, freshness, parameters at run time."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import ValidationError

from mbf_abstract.geometry import Path, Pose, Twist
from mbf_abstract.geometry.transform_buffer import TransformBuffer
from mbf_abstract.maps.layers.layer_list import LayerListError
from mbf_abstract.maps.tracking.avoidance import AvoidanceParameters, MovingAround
from mbf_abstract.maps.tracking.blocking import blockages
from mbf_abstract.maps.tracking.objects import Motion
from mbf_costmap_nav.grid.costmap import LETHAL, Costmap
from mbf_costmap_nav.kernels.map.rasterisation import raise_discs
from mbf_costmap_nav.map.static_maps import StaticMaps


def test_where_somebody_will_be_costs_the_less_the_later_it_is(hall):
    x, y = hall.watches(3.0, 4.0, 0.8, 0.0)
    (seen,) = hall.objects
    costs = [hall.cost(seen.x + seen.vx * seconds, y) for seconds in (0.6, 1.1, 1.6)]
    assert 0.8 > costs[0] > costs[1] > costs[2] > 0.0
    assert hall.cost(x + 0.8 * 2.6, y) == 0.0 == hall.cost(x + 0.8, y + 1.0)


def test_a_prediction_is_as_wide_as_the_object_and_the_robot(hall):
    hall.watches(3.0, 4.0, 0.8, 0.0)
    (seen,) = hall.objects
    aside = seen.radius + 0.2
    ahead = seen.x + 0.5
    assert hall.cost(ahead, seen.y + aside - 0.1) > 0.0
    assert hall.cost(ahead, seen.y + aside + 0.15) == 0.0


PASSED = {"max_vel_x": 1.2}  # m/s; the sensor stands at (5, 1), so this robot would come near in time


@pytest.mark.parametrize("velocity", [(0.0, 0.5), (0.3, 0.4)])
def test_who_goes_slowly_away_from_the_robot_costs_for_as_long_as_it_takes_to_pass(make_hall, velocity):
    hall = make_hall(**PASSED)
    hall.watches(5.0, 2.0, *velocity)
    (seen,) = hall.objects
    for seconds in (2.5, 4.0):
        x, y = seen.position_in(seconds)
        assert hall.cost(x, y) > 0.0
    x, y = seen.position_in(2.5)
    aside = seen.radius + 0.2 + 0.1 + 0.5 * seen.speed  # both radii, and how near the guard lets the robot drive
    across = -seen.vy / seen.speed, seen.vx / seen.speed
    assert hall.cost(x + aside * across[0], y + aside * across[1]) > 0.0


@pytest.mark.parametrize(
    ("place", "velocity", "changes"),
    [
        ((5.0, 4.5), (0.0, -0.5), {}),  # comes
        ((5.0, 2.0), (0.0, 0.5), {"max_vel_x": 0.5}),  # as fast as the robot
        ((5.0, 2.0), (0.0, 0.5), {"passing_time": 0.0}),
        ((2.5, 1.5), (0.5, 0.0), {}),  # the robot is ahead of it
        ((5.0, 5.0), (0.0, 0.4), {"max_vel_x": 0.6}),  # far away
    ],
)
def test_nobody_else_costs_longer_than_the_prediction_time(make_hall, place, velocity, changes):
    hall = make_hall(**{**PASSED, **changes})
    hall.watches(*place, *velocity, scans=10)
    (seen,) = hall.objects
    x, y = seen.position_in(2.0 + (seen.radius + 0.3) / seen.speed)
    assert hall.cost(x, y) == 0.0


def test_a_map_that_moves_with_the_robot_is_for_controllers_and_has_no_such_costs(make_rolling_hall):
    hall = make_rolling_hall(**PASSED)
    hall.watches(5.0, 2.0, 0.0, 0.5)
    (seen,) = hall.objects
    near, far = seen.position_in(1.0), seen.position_in(2.0 + (seen.radius + 0.3) / seen.speed)
    assert hall.cost(*near) > 0.0 == hall.cost(*far)


def test_who_comes_from_behind_the_robot_costs_up_to_there(make_rolling_hall):
    """Else a controller that is slow in costs would be so because somebody follows it."""
    costs = {}
    for where, (x, speed) in {"behind": (2.6, 0.8), "ahead": (7.4, -0.8)}.items():
        hall = make_rolling_hall()
        last, y = hall.watches(x, 1.0, speed, 0.0)
        costs[where] = hall.cost(last + 0.5 * speed, y), hall.cost(5.0, 1.0)
    assert costs["behind"][0] > 0.0 == costs["behind"][1]
    assert costs["ahead"][0] > costs["ahead"][1] > 0.0


def test_in_a_map_that_plans_are_made_on_who_comes_from_behind_costs_beyond_the_robot(hall):
    """Else plans of a robot that passes somebody turn in close before them once it is ahead."""
    hall.watches(2.6, 1.0, 0.8, 0.0)
    assert hall.cost(5.0, 1.0) > 0.0


def test_who_stands_has_no_predictions_and_stays_an_obstacle(hall):
    for _ in range(10):
        hall.sees((3.0, 4.0))
    (seen,) = hall.objects
    assert seen.motion is Motion.WAITING
    assert hall.cost(3.0, 3.75) == math.inf
    assert hall.cost(3.6, 4.0) == 0.0


def test_the_trail_of_a_moving_object_is_free_although_the_obstacle_layer_keeps_it(hall):
    x, y = hall.watches(3.0, 4.0, 0.8, 0.0, scans=30)
    assert hall.cost(x, y - 0.25) == math.inf
    assert hall.cost(x - 1.0, y - 0.25) == 0.0


def test_without_clearing_the_trail_stays(make_hall):
    hall = make_hall(clear_trails=False)
    x, y = hall.watches(3.0, 4.0, 0.8, 0.0, scans=30)
    assert hall.cost(x - 1.0, y - 0.25) == math.inf


def test_what_stands_in_a_trail_is_an_obstacle_again(hall):
    x, y = hall.watches(3.0, 4.0, 0.8, 0.0, scans=30)
    for _ in range(3):
        hall.sees((x, y), (x - 1.0, y))
    assert hall.cost(x - 1.0, y - 0.25) == math.inf


def test_a_wall_of_the_static_map_is_no_object_and_never_a_trail(hall):
    for _ in range(10):
        hall.sees()
    assert hall.objects == ()
    hall.watches(3.0, 4.0, 0.0, 0.8, scans=25)  # up to the wall
    assert hall.map.layers["moving"].tracked_objects(hall.now)
    hall.watches(3.0, 5.8, 0.8, 0.0)  # and along it
    if hall.name == "costmap":
        assert (hall.map.snapshot().cells[65] == LETHAL).all()


@pytest.mark.parametrize("name", ["moving", None])
def test_clear_forgets_objects_predictions_and_trails(hall, name):
    x, y = hall.watches(3.0, 4.0, 0.8, 0.0)
    assert "moving" in hall.map.clear(None if name is None else [name])
    hall.map.update(Pose.planar(5.0, 1.0), hall.now)
    assert hall.objects == () and hall.cost(x + 0.8, y) == 0.0
    assert "'lidar' is in the map since it was cleared" in hall.map.layers["moving"].stale_reason(hall.now)
    hall.sees((x, y))
    assert hall.map.layers["moving"].stale_reason(hall.now) == ""


@pytest.mark.parametrize("whole", [True, False])
def test_clearing_does_not_blind_the_guard(hall, whole):
    """The robot stops before who was cleared as before, until that one is seen again or would be forgotten anyway."""
    x, y = hall.watches(3.0, 4.0, 0.8, 0.0)
    pose, ahead = Pose.planar(x + 0.6, y, math.pi), Twist.planar(0.4)

    def share(now):
        return hall.map.safe_share(pose, Twist(), ahead, now)[0]

    assert share(hall.now) == 0.0
    if whole:
        hall.map.clear()
    else:
        hall.map.clear_area(Pose.planar(x, y), 2.0)
    hall.map.update(Pose.planar(5.0, 1.0), hall.now)
    assert hall.objects == () and share(hall.now) == 0.0
    hall.sees((x + 0.08, y))
    assert len(hall.objects) == 1 and share(hall.now) == 0.0
    hall.map.clear()
    assert share(hall.now + 0.9) == 0.0 and share(hall.now + 3.1) == 1.0, "as near as that, for lost_contact_time"


def test_heights_count_only_on_maps_that_know_them(hall):
    """A robot on the third storey of a building drives on the costmap of that storey, where nothing has a height."""
    x, y = hall.watches(3.0, 4.0, 0.8, 0.0)
    above = Pose((x + 0.8, y, 6.0), Pose.planar(0.0, 0.0, math.pi).orientation)
    share, *_ = hall.map.safe_share(above, Twist(), Twist.planar(0.4), hall.now)
    around = MovingAround.on(hall.map, above, hall.now, AvoidanceParameters())
    path = Path.from_points(np.array([[x - 1.0, y, 6.0], [x + 1.0, y, 6.0]]))
    on_it = blockages(hall.map.robot_box, path, hall.objects, 2.0, hall.map.same_storey)
    assert (share < 1.0, around.anybody, bool(on_it)) == (hall.name == "costmap",) * 3


def test_who_waits_is_passed_slowly_until_it_is_parked(hall):
    """On both maps: it loads, and may set off."""
    for _ in range(20):
        hall.sees((4.0, 4.0))
    pose, ahead = Pose.planar(3.4, 3.6), Twist.planar(0.6)
    share, reason, _ = hall.map.safe_share(pose, ahead, ahead, hall.now)
    assert share == 0.5 and "waits beside the way" in reason
    assert hall.map.safe_share(Pose.planar(3.4, 2.8), ahead, ahead, hall.now)[0] == 1.0, "with more room"
    parameters = hall.map.layers["moving"].parameters.model_copy(update={"parked_time": 1.0})
    hall.map.set_layer_parameters("moving", parameters)
    hall.sees((4.0, 4.0))
    assert hall.map.safe_share(pose, ahead, ahead, hall.now)[0] == 1.0


@pytest.mark.parametrize("inside", [True, False])
def test_clearing_an_area_forgets_who_is_in_it(hall, inside):
    for step in range(15):
        hall.sees((3.0 + 0.08 * step, 4.0), (8.0, 2.0 + 0.08 * step))
    left, right = hall.objects
    hall.map.clear_area(Pose.planar(4.0, 4.0), 3.0, ["moving"], inside=inside)
    hall.map.update(Pose.planar(5.0, 1.0), hall.now)
    assert [known.number for known in hall.objects] == [(right if inside else left).number]


def test_a_silent_sensor_makes_the_map_stale(hall):
    hall.watches(3.0, 4.0, 0.8, 0.0)
    assert hall.map.stale_reason(hall.now) == ""
    assert "observation source 'lidar' is silent for 3.00 s" in hall.map.layers["moving"].stale_reason(hall.now + 3.0)


def test_predictions_can_be_switched_off_at_run_time(hall):
    x, y = hall.watches(3.0, 4.0, 0.8, 0.0)
    parameters = hall.map.layers["moving"].parameters.model_copy(update={"prediction_time": 0.0})
    hall.map.set_layer_parameters("moving", parameters, until=hall.now + 1.0)
    hall.map.update(Pose.planar(5.0, 1.0), hall.now)
    assert hall.cost(x + 0.8, y) == 0.0 and len(hall.objects) == 1
    hall.map.update(Pose.planar(5.0, 1.0), hall.now + 1.0)
    hall.sees((x + 0.08, y))
    assert hall.cost(x + 0.8, y) > 0.0


def test_a_layer_without_sensors_is_refused(make_hall):
    with pytest.raises(LayerListError, match=r"layer 'moving': sources: .*the name of at least one sensor"):
        make_hall(sources=[])


places = st.floats(-2.0, 9.0)
discs_and_values = st.lists(st.tuples(places, places, st.floats(0.0, 4.0), st.integers(0, 252)), max_size=5)


@given(discs_and_values, st.sampled_from([0, 100, 255]))
@settings(max_examples=40, deadline=None)
def test_discs_raise_the_cells_whose_middle_they_hold(discs, background):
    cells = np.full((6, 7), background, dtype=np.uint8)
    expected = cells.astype(int)
    for x, y, radius, value in discs:
        for row in range(6):
            for column in range(7):
                held = (column + 0.5 - x) ** 2 + (row + 0.5 - y) ** 2 <= radius**2
                old = -1 if expected[row, column] == 255 else expected[row, column]
                expected[row, column] = value if held and value > old else expected[row, column]
    rows = np.array(discs, dtype=float).reshape(-1, 4)
    raise_discs(cells, rows[:, :3], rows[:, 3].astype(np.uint8))
    assert cells.tolist() == expected.tolist()


def test_a_floor_plan_explains_what_is_near_its_walls():
    cells = np.zeros((20, 30), dtype=np.uint8)
    cells[10, :] = LETHAL
    static = StaticMaps(TransformBuffer())
    plan = Costmap(cells, 0.1)
    static.add(lambda: plan)
    points = np.array([[1.0, 1.05, 0.5], [1.0, 1.25, 0.5], [1.0, 1.45, 0.5], [50.0, 1.05, 0.5]])
    assert static.explain(points, "map", 0.2).tolist() == [True, True, False, False]


def test_bad_limits_are_refused():
    from mbf_costmap_nav.layers.moving_obstacles import MovingObstaclesLayerParameters

    with pytest.raises(ValidationError, match="prediction_cost"):
        MovingObstaclesLayerParameters(sources=("lidar",), prediction_cost=1.0)
