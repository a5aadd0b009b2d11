"""Maps are shown and asked over the bridge, whichever backend they are of: a room with a blocked spot at (3, 3)."""

import numpy as np
import pytest
import roslibpy
import trimesh

from mbf_abstract.geometry import Pose
from mbf_abstract.server.factory import read_config
from mbf_abstract.testing.loopback import LoopbackSession
from mbf_abstract.time.clock import WallClock
from mbf_mesh_nav.mesh.heightfield_mesh import heightfield_mesh

SPOT = "[[2.8, 2.8], [3.2, 2.8], [3.2, 3.2], [2.8, 3.2]]"
CONFIGS = {
    "mesh": """
backend: mesh
mesh_map: {mesh_file: floor.ply, layers: [{name: area, type: keepout}], area: {regions: [{polygon: SPOT}]}}
planners: [{name: shortest, type: dijkstra}]
""",
    "costmap": """
backend: costmap
global_costmap:
  {width: 4.0, height: 4.0, layers: [{name: area, type: keepout}], area: {zones: [{name: spot, polygon: SPOT}]}}
local_costmap:
  {width: 4.0, height: 4.0, layers: [{name: area, type: keepout}], area: {zones: [{name: spot, polygon: SPOT}]}}
planners: [{name: shortest, type: dijkstra}]
""",
}
LETHAL, FREE = 2, 0


@pytest.fixture(params=CONFIGS)
def served(request, tmp_path, serving):
    """The backend's name and the port of its bridge; the robot stands at (1, 1)."""
    trimesh.Trimesh(*heightfield_mesh(np.zeros((21, 21)), 0.2, 0.2), process=False).export(tmp_path / "floor.ply")
    (tmp_path / "robot.yaml").write_text(CONFIGS[request.param].replace("SPOT", SPOT))
    session = LoopbackSession(Pose.planar(1.0, 1.0), WallClock())
    session.serve(*read_config(tmp_path / "robot.yaml"), session.robot, session.transforms)
    _, server = serving(session)
    return request.param, server.port


def stamped(x, y):
    return {"header": {"frame_id": "/map"}, "pose": {"position": {"x": x, "y": y}}}


def test_places_and_paths_are_checked_and_a_free_pose_is_found(served, connect):
    ros = connect(served[1])

    def ask(name, **request):
        service = roslibpy.Service(ros, f"/move_base_flex/{name}", "")
        return service.call(roslibpy.ServiceRequest({"costmap": 2, **request}), timeout=20)

    blocked = {"header": {"frame_id": "map"}, "point": {"x": 3.0, "y": 3.0}}
    assert ask("check_point_cost", point=blocked)["state"] == LETHAL
    assert ask("check_pose_cost", current_pose=True)["state"] == FREE
    assert ask("check_pose_cost", pose=stamped(3.0, 3.0))["state"] == LETHAL
    path = {"poses": [stamped(1.0, 1.0), stamped(2.0, 2.0), stamped(3.0, 3.0), stamped(3.5, 3.5)]}
    answer = ask("check_path_cost", path=path, return_on=LETHAL)
    assert (answer["last_checked"], answer["state"]) == (2, LETHAL)
    beside = ask("find_valid_pose", pose=stamped(3.0, 3.0), dist_tolerance=1.0, angle_tolerance=3.2)
    place = beside["pose"]["pose"]["position"]
    assert beside["state"] == FREE and max(abs(place["x"] - 3.0), abs(place["y"] - 3.0)) >= 0.2


def test_the_map_is_sent_to_whoever_begins_to_listen(served, connect, answers):
    backend, port = served
    topics = {
        "costmap": {
            "/global_costmap/costmap": "nav_msgs/OccupancyGrid",
            "/local_costmap/costmap": "nav_msgs/OccupancyGrid",
        },
        "mesh": {
            "/move_base_flex/mesh": "mesh_msgs/MeshGeometryStamped",
            "/move_base_flex/vertex_costs": "mesh_msgs/MeshVertexCostsStamped",
            "/move_base_flex/mesh_markers": "visualization_msgs/MarkerArray",
        },
    }[backend]
    for _ in range(2):  # the second client comes when the first one has its map
        ros, got = connect(port), {}
        for topic, kind in topics.items():
            got[topic] = answers()
            roslibpy.Topic(ros, topic, kind).subscribe(got[topic])
        maps = {topic: messages.wait()[-1] for topic, messages in got.items()}
    if backend == "costmap":
        grid = maps["/global_costmap/costmap"]
        cells = np.array(grid["data"]).reshape(grid["info"]["height"], grid["info"]["width"])
        resolution = grid["info"]["resolution"]
        assert cells[int(3.0 / resolution), int(3.0 / resolution)] == 100 and cells[0, 0] == 0
    else:
        geometry, costs = (maps[f"/move_base_flex/{name}"] for name in ("mesh", "vertex_costs"))
        vertices = [(v["x"], v["y"]) for v in geometry["mesh_geometry"]["vertices"]]
        forbidden = [at for at, cost in zip(vertices, costs["mesh_vertex_costs"]["costs"], strict=True) if cost is None]
        assert geometry["uuid"] == costs["uuid"] and len(geometry["mesh_geometry"]["faces"]) == 800
        assert forbidden and all(2.7 < min(at) and max(at) < 3.3 for at in forbidden)
