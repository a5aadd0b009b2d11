"""The parts of the page that can be looked at one by one: arrows, arcs, words, colours, pace."""

import numpy as np
import pytest

from mbf_abstract.events import Event, EventKind
from mbf_abstract.executives.tree_events import NodeState
from mbf_abstract.geometry import AckermannCommand, Pose, Twist, quaternion_from_yaw
from mbf_abstract.maps.view import FieldView, GridView
from mbf_abstract.time.pace import MAX_LAG, Pace
from mbf_abstract.time.sim_clock import SimClock
from terrain.viewer.live.ground import costs_at, legend_html
from terrain.viewer.live.log import LiveLog
from terrain.viewer.live.moving import AHEAD, AHEAD_STEPS, field_arrows, motion_of, predicted_points
from terrain.viewer.live.overlay import Overlay
from terrain.viewer.live.plots import LENGTH, PERIOD, History
from terrain.viewer.live.session import ViewOptions
from terrain.viewer.live.status_html import lines_html
from terrain.viewer.pictures.colours import BAD, FLOOR, GOOD, NEITHER, WALL, cost_ramp
from terrain.viewer.reports.tree_html import tree_html
from terrain.viewer.server.page_server import page_server


# ------------------------------------------------------------------------------------------------- scene
@pytest.mark.parametrize("command", [Twist.planar(0.8), Twist.planar(0.5, wz=0.7), Twist.planar(-0.3, 0.2, 1.5)])
def test_the_way_ahead_is_what_small_steps_of_the_command_lead_to(command):
    pose = Pose((1.0, 2.0, 0.5), quaternion_from_yaw(0.6))
    x, y, yaw = pose.x, pose.y, pose.yaw
    steps = 20_000
    for _ in range(steps):
        x += (command.vx * np.cos(yaw) - command.vy * np.sin(yaw)) * AHEAD / steps
        y += (command.vx * np.sin(yaw) + command.vy * np.cos(yaw)) * AHEAD / steps
        yaw += command.wz * AHEAD / steps

    points = predicted_points(pose, motion_of(command))

    assert len(points) == AHEAD_STEPS + 1
    np.testing.assert_allclose(points[0], pose.position)
    np.testing.assert_allclose(points[-1], [x, y, 0.5], atol=2e-3)


def test_nothing_is_predicted_for_a_robot_that_stands_or_for_a_car():
    assert motion_of(Twist()) is None
    assert motion_of(AckermannCommand(1.0, 0.2)) is None


def test_a_field_has_one_arrow_for_each_square_and_it_points_as_the_field_does():
    x, y = np.meshgrid(np.linspace(0.0, 10.0, 200), np.linspace(0.0, 5.0, 100))
    points = np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)])
    field = FieldView(points, np.tile(np.float32([0.6, 0.8, 0.0]), (len(points), 1)))

    arrows, spacing = field_arrows(field)

    assert spacing == pytest.approx(0.25)
    assert 40 * 20 <= len(arrows) <= 42 * 22
    np.testing.assert_allclose(arrows[:, 1] - arrows[:, 0], np.tile([0.105, 0.14, 0.0], (len(arrows), 1)), atol=1e-6)


def test_points_take_the_cost_of_the_cell_they_lie_in_and_none_outside():
    view = GridView(np.arange(12, dtype=np.float32).reshape(3, 4), (-1.0, 3.0, 10.0, 11.5))

    costs, inside = costs_at(view, np.array([[-0.9, 10.1], [2.9, 11.4], [1.5, 10.6], [3.1, 10.2], [0.0, 9.9]]))

    assert inside.tolist() == [True, True, True, False, False]
    assert costs[:3].tolist() == [0.0, 11.0, 6.0]
    assert np.isnan(costs[3:]).all()


def test_the_ramp_gets_darker_with_cost_and_what_is_forbidden_looks_like_a_wall():
    colours = cost_ramp(np.append(np.linspace(0.0, 1.0, 9), np.inf))

    lightness = colours[:9] @ [0.2126, 0.7152, 0.0722]
    assert (np.diff(lightness) < 0.0).all()
    assert tuple(colours[9]) == WALL


def test_an_overlay_is_drawn_again_only_when_it_has_changed_and_goes_with_its_box():
    with page_server(18080) as server:
        overlay, drawn = Overlay(server.gui, "thing"), []

        def draw():
            drawn.append(1)
            return server.scene.add_frame("/thing")

        for key in (1, 1, 2):
            overlay.update(key, draw)
        assert len(drawn) == 2 and server.scene.get_handle_by_name("/thing") is not None
        overlay._box.value = False
        overlay.update(3, draw)
        assert len(drawn) == 2 and server.scene.get_handle_by_name("/thing") is None
        overlay._box.value = True
        overlay.update(3, draw)
        overlay.update(4, lambda: None)
        assert len(drawn) == 3 and server.scene.get_handle_by_name("/thing") is None


# ------------------------------------------------------------------------------------------------- words
def finished(time, source, outcome, message):
    return Event(time, EventKind.GOAL_FINISHED, source, {"goal_id": 1, "outcome": outcome, "message": message})


def test_the_log_keeps_the_last_end_of_each_action_and_the_newest_line_first():
    log = LiveLog()
    for event in (
        finished(1.0, "get_path", 0, "plan found"),
        finished(2.0, "exe_path", 110, "a box"),
        finished(3.0, "get_path", 51, "enough"),
        Event(4.0, EventKind.LEASE_GRANTED, "gate", {}),
    ):
        log.write(event)

    snapshot = log.snapshot()

    assert [(line.time, line.colour) for line in snapshot.lines] == [(3.0, NEITHER), (2.0, BAD), (1.0, GOOD)]
    assert snapshot.ends["get_path"].text == "CANCELED: enough"


def test_a_path_that_is_swapped_for_a_newer_one_is_no_news():
    log = LiveLog()
    log.write(finished(2.0, "exe_path", 101, "preempted by a new plan"))
    log.write(finished(3.0, "exe_path", 101, "canceled in the live view"))

    assert [line.text for line in log.snapshot().lines] == ["CANCELED: canceled in the live view"]


def test_a_snapshot_of_the_tree_does_not_change_when_the_tree_does():
    log = LiveLog()
    log.write(Event(0.0, EventKind.TREE, "tree", {"tree": "t", "nodes": [{"name": "n", "type": "T", "depth": 0}]}))
    before = log.snapshot()
    log.write(Event(0.1, EventKind.TREE, "tree", {"tree": "t", "tick": 1, "changes": [[0, "RUNNING", ""]]}))

    assert (before.nodes[0].status, log.snapshot().nodes[0].status) == ("INVALID", "RUNNING")


def test_words_from_outside_cannot_become_part_of_the_page():
    log = LiveLog()
    log.write(finished(1.0, "<b>", 110, "<script>"))

    assert "<script>" not in lines_html(log.snapshot().lines)
    assert "<i>" not in tree_html([NodeState('<i>"', "T", 0, "FAILURE", "<i>")])


def test_a_tree_is_indented_and_says_why_a_node_has_failed():
    lines = tree_html(
        [NodeState("root", "Sequence", 0, "FAILURE", "no way"), NodeState("leaf", "GetPath", 1, "SUCCESS")]
    )

    assert "✗ root" in lines and "no way" in lines
    assert "padding-left:12px" in lines and "✓ leaf" in lines


def test_the_legend_names_both_ends():
    assert ">free<" in legend_html([FLOOR, WALL], "free", "costly") and ">costly<" in legend_html(
        [FLOOR], "a", "costly"
    )


# -------------------------------------------------------------------------------------------------- time
def test_the_history_keeps_two_minutes_of_samples():
    history = History()
    for step in range(5 * LENGTH):
        time = step * PERIOD / 2.0
        if history.is_due(time):
            history.add(time, 0.5, 3.0, 10.0)

    times = history.columns()[0]
    assert len(times) == LENGTH
    np.testing.assert_allclose(np.diff(times), PERIOD)


def test_steps_are_as_far_apart_on_the_wall_as_the_speed_says():
    wall = SimClock()
    pace = Pace(wall)
    stamps = []
    for step in range(1, 11):
        pace.wait(0.1 * step, speed=2.0)
        stamps.append(wall.now())

    np.testing.assert_allclose(stamps, 0.05 * np.arange(1, 11))


def test_without_a_limit_there_is_no_wait_and_who_is_late_catches_up_a_little_only():
    wall = SimClock()
    pace = Pace(wall)
    pace.wait(100.0, speed=0.0)
    assert wall.now() == 0.0
    wall.sleep(10.0)
    pace.wait(100.1, speed=1.0)
    pace.wait(101.1, speed=1.0)

    assert wall.now() == pytest.approx(10.0 + 1.0 - MAX_LAG)


def test_a_negative_speed_is_refused():
    with pytest.raises(ValueError, match="speed must not be negative"):
        ViewOptions(speed=-1.0)
