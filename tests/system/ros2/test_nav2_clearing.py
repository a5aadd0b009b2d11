"""A client of Nav2 asks for costmaps and clears them: is a wall that the robot does not see any more still there?"""

import math

import pytest

pytestmark = [pytest.mark.ros2, pytest.mark.timeout(900, func_only=True)]
CLIENT, OPTIONS = "commander.py", ("--amcl",)
CONFIG = """
backend: costmap
global_costmap: {SIZE, layers: [{name: seen, type: obstacle}], seen: {SOURCES}}
local_costmap: {SIZE, layers: [{name: seen, type: obstacle}], seen: {SOURCES}}
planners: [{name: shortest, type: straight_line}]
controllers: [{name: follow, type: follow_path}]
""".replace("SIZE", "width: 20.0, height: 20.0, resolution: 0.2, origin_x: -10.0, origin_y: -10.0").replace(
    "SOURCES", "sources: {scan: {obstacle_max_range: 5.0}}"
)
PLACES = [(0.0, 0.0), *((0.2 * i, 0.2 * j) for i in range(-10, 11) for j in range(15, 26))]  # the robot, then the wall
POSES = [{"header": {"frame_id": "map"}, "pose": {"position": {"x": x, "y": y}}} for x, y in PLACES]


def ask(trio, service, request):
    return trio.client.wait(trio.client.do(order="ask", service=service, request=request), "answer")


@pytest.mark.parametrize(
    ("service", "limits", "is_kept"),
    [
        ("global_costmap/clear_entirely_global_costmap", {}, False),
        ("global_costmap/clear_around_global_costmap", {"reset_distance": 2.0}, True),
        ("global_costmap/clear_around_global_costmap", {"reset_distance": 16.0}, False),
        ("global_costmap/clear_except_global_costmap", {"reset_distance": 2.0}, False),
        ("global_costmap/clear_except_global_costmap", {"reset_distance": 16.0}, True),
        ("local_costmap/clear_entirely_local_costmap", {}, True),
        ("local_costmap/clear_around_local_costmap", {"reset_distance": 16.0}, True),
        ("local_costmap/clear_except_local_costmap", {"reset_distance": 2.0}, True),
    ],
)
def test_a_service_clears_the_part_it_names_of_the_map_it_names(trio, service, limits, is_kept):
    """Whether the global costmap still has the wall 4 m on the left of the robot."""

    def blocked():
        indices = ask(trio, "is_path_valid", {"path": {"poses": POSES}})["invalid_pose_indices"]
        return [PLACES[i] for i in indices]

    while not blocked():
        pass
    trio.robot.set("scan", "off")
    try:
        before = blocked()
        assert before and all(math.hypot(x, y - 4.0) < 1.8 for x, y in before)
        ask(trio, service, limits)
        assert blocked() == (before if is_kept else [])
    finally:
        trio.robot.set("scan", "on")


@pytest.mark.parametrize("name", ["global_costmap", "local_costmap"])
def test_a_costmap_is_handed_out_with_the_wall(trio, name):
    def wall():
        costmap = ask(trio, f"{name}/get_costmap", {})["map"]
        metadata, data = costmap["metadata"], costmap["data"]
        assert (metadata["size_x"], metadata["size_y"], len(data)) == (100, 100, 10_000)
        return {divmod(i, metadata["size_x"])[0] for i, cost in enumerate(data) if cost == 254}

    while not (rows := wall()):
        pass
    assert rows <= {69, 70}  # 4 m on the left of the robot
