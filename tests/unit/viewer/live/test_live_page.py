"""What stands in the scene and in the panels of the page while a robot drives, on both maps; no browser needed."""

import numpy as np
import pytest

from mbf_abstract.goals.goal_types import RefinePathGoal
from mbf_abstract.maps.view import GridView, MeshView
from terrain.scenarios.actors import OtherRobot, Walker
from terrain.scenarios.scenario import PlanarPose, load_scenario
from terrain.session.executives import make_executive
from terrain.session.goal_sequence import GoalSequence
from terrain.session.session import Session, SessionOptions
from terrain.viewer.live.controls import LiveControls
from terrain.viewer.live.log import LiveLog
from terrain.viewer.live.moving import MovingThings
from terrain.viewer.live.page import LivePage
from terrain.viewer.live.plots import History
from terrain.viewer.live.stick import Stick
from terrain.viewer.server.page_server import page_server
from terrain.viewer.server.visitor_channel import VisitorChannel

NODES = ("ground", "map", "local_map", "lethal", "robot", "plan", "track", "ahead", "field", "scan", "goal_asked_for")


def stick_of(session, controls):
    return Stick(session.navigator.server, session.clock, controls.take_over, controls.note_end_of_teleoperation)


def look_once(session, controls, sequence, time, port):
    """Drive until ``time``, draw the page once, end the run; returns the names of the nodes and the panels' words."""
    seen = {}
    log, history = LiveLog(), History()
    session.events.add_sink(log)
    with page_server(port) as server:
        page = LivePage(server, session, sequence, controls, log, stick_of(session, controls), VisitorChannel(""))
        sequence.on_goal.append(page.things.show_goal)

        def look(now):
            if now >= time and not seen:
                page.show(now, history)
                seen["nodes"] = {name for name in NODES if server.scene.get_handle_by_name(f"/{name}") is not None}
                seen["words"] = page._headline.content + page._actions.content + page._tree.content
                sequence.end("seen")

        session.loop.on_tick.append(look)
        session.run()
        sequence.visit_goals()
        assert not page.is_watched
    return seen["nodes"], seen["words"]


def test_on_a_mesh_the_page_shows_layers_plan_field_and_what_is_forbidden(steered):
    run = steered("navigation")
    run.at(
        0.6, lambda: run.controls.choose("cvp", "follower"), lambda: run.controls.place(((9.0, 7.0, 50.0), (0, 0, -1)))
    )

    nodes, words = look_once(run.session, run.controls, run.sequence, 3.0, 18220)

    assert nodes == set(NODES) - {"map", "local_map"}
    assert "going to 9.0, 7.0" in words and "follow path" in words and "plan found" in words


def test_the_plan_in_the_scene_is_the_refined_one_and_the_field_that_of_the_planner(meadow):
    with Session(meadow) as session, page_server(18230) as server:
        things = MovingThings(server, session, 1.0)
        plan = session.navigator.get_path(session.goals[0], planner="cvp")
        things.show(0.0, "", is_driving=True)
        planned = server.scene.get_handle_by_name("/plan").points[:, 0, :2]
        refined = session.navigator.send(RefinePathGoal(plan.path, "string_pulling")).wait().refined_path
        things.show(0.1, "", is_driving=True)
        shown = server.scene.get_handle_by_name("/plan").points[:, 0, :2]
        assert server.scene.get_handle_by_name("/field") is not None

    np.testing.assert_allclose(planned, plan.path.positions[:-1, :2], atol=1e-5)
    np.testing.assert_allclose(shown, refined.positions[:-1, :2], atol=1e-5)
    assert len(shown) != len(planned)


def test_on_costmaps_the_page_shows_both_maps():
    scenario = load_scenario("indoor")
    goal = PlanarPose(x=scenario.start.x + 2.0, y=scenario.start.y + 3.0, yaw=1.0)
    with_goal = scenario.model_copy(update={"goals": (goal,)})
    session = Session(with_goal, SessionOptions(backend="costmap"))
    try:
        sequence = GoalSequence(session, make_executive("move_base", session.navigator), stay=True)
        nodes, words = look_once(session, LiveControls(session, sequence), sequence, 3.0, 18230)
    finally:
        session.close()

    assert nodes == {"map", "local_map", "robot", "plan", "track", "ahead", "scan"}
    assert "No behaviour tree runs" in words


def test_people_and_other_robots_are_drawn_where_they_are_now(meadow):
    route = ((2.0, 2.0), (10.0, 2.0))
    actors = (Walker(type="walker", route=route), OtherRobot(type="robot", route=route, start=4.0))
    with Session(meadow.model_copy(update={"actors": actors})) as session, page_server(18240) as server:
        sequence = GoalSequence(session, make_executive("move_base", session.navigator))
        controls = LiveControls(session, sequence)
        page = LivePage(server, session, sequence, controls, LiveLog(), stick_of(session, controls), VisitorChannel(""))
        shown = []
        for time in (1.0, 2.0):
            session.clock.sleep(1.0)
            page.show(time, History())
            frames = [server.scene.get_handle_by_name(f"/actor_{number}") for number in range(2)]
            assert [tuple(frame.position) for frame in frames] == [a.pose().position for a in session.recorder.actors]
            shown.append(frames[0].position[0])

        assert shown[1] - shown[0] == pytest.approx(0.8, abs=0.05), "somebody walks at 0.8 m/s"
        assert server.scene.get_handle_by_name("/actor_0/person") and server.scene.get_handle_by_name("/actor_1/robot")


def test_a_mesh_server_shows_each_layer_by_name_the_default_one_first(meadow):
    with Session(meadow) as session:
        server = session.navigator.server
        default, *others = server.map_views
        views = {name: server.map_view(name) for name in server.map_views}

        assert default == server.mesh_map.default_layer and {default, *others} == set(server.mesh_map.layers)
        assert all(isinstance(view, MeshView) for view in views.values())
        np.testing.assert_array_equal(views[default].costs, server.map_view().costs)
        for name, view in views.items():
            layer = server.mesh_map.layers[name]
            assert (np.isinf(view.costs) == (layer.lethal | np.isinf(layer.costs))).all()
        with pytest.raises(KeyError):
            server.map_view("no such layer")


def test_only_a_planner_with_a_field_has_one_to_show_and_it_leads_to_the_goal(meadow):
    with Session(meadow) as session:
        server, goal = session.navigator.server, session.goals[0]
        straight = session.navigator.get_path(goal, planner="any_angle").path
        field = server.field_view(session.navigator.get_path(goal, planner="cvp").path)

        assert server.field_view(straight) is None
        np.testing.assert_allclose(np.linalg.norm(field.directions, axis=1), 1.0, atol=1e-3)
        near = np.linalg.norm(field.points - goal.position, axis=1)
        towards = ((goal.position - field.points) * field.directions).sum(axis=1) / np.maximum(near, 1e-9)
        assert np.median(towards[(near > 0.5) & (near < 3.0)]) > 0.8


def test_a_costmap_server_shows_both_maps_where_they_are():
    with Session("indoor", SessionOptions(backend="costmap")) as session:
        server, robot = session.navigator.server, session.simulation.robot.pose()
        whole, local = (server.map_view(name) for name in server.map_views)

        assert isinstance(whole, GridView) and server.map_view().extent == whole.extent
        assert local.extent[1] - local.extent[0] == pytest.approx(5.0)
        assert local.extent[0] < robot.x < local.extent[1] and local.extent[2] < robot.y < local.extent[3]
