"""What a stranger does in the first hour: own planner, own robot, own scenario, a sweep, a figure and a table.

Every command is typed as a user would, in an empty folder. The fresh environment is that of ``.ci/run``.
"""

import csv
import os
import subprocess
import sys

import pytest

pytestmark = pytest.mark.timeout(300)

ROBOT = """
<robot name="cart">
  <link name="base_link">
    <inertial><mass value="12"/><inertia ixx="0.2" ixy="0" ixz="0" iyy="0.3" iyz="0" izz="0.4"/></inertial>
    <collision><origin xyz="0 0 0.15"/><geometry><box size="0.5 0.36 0.16"/></geometry></collision>
  </link>
  {wheels}
  <link name="caster">
    <inertial><mass value="0.3"/><inertia ixx="0.001" ixy="0" ixz="0" iyy="0.001" iyz="0" izz="0.001"/></inertial>
    <collision><geometry><sphere radius="0.05"/></geometry></collision>
  </link>
  <joint name="caster_joint" type="fixed">
    <parent link="base_link"/><child link="caster"/><origin xyz="-0.2 0 0.05"/>
  </joint>
</robot>
"""
WHEEL = """
  <link name="{side}_wheel">
    <inertial><mass value="1"/><inertia ixx="0.003" ixy="0" ixz="0" iyy="0.003" iyz="0" izz="0.005"/></inertial>
    <collision><geometry><cylinder radius="0.1" length="0.05"/></geometry></collision>
  </link>
  <joint name="{side}_wheel_joint" type="continuous">
    <parent link="base_link"/><child link="{side}_wheel"/>
    <origin xyz="0.1 {y} 0.1" rpy="1.5707963 0 0"/><axis xyz="0 0 -1"/>
  </joint>
"""
SCENARIO = """
name: my_crossing
proves: My robot crosses my hills.
backend: mesh
navigation: {mesh: navigation.yaml}
world: {type: generated, size: [10.0, 8.0], spacing: 0.5, median_slope: 3.0}
physics: kinematic
robot: {urdf: cart.urdf, max_speed: 1.0}
start: {x: 2.0, y: 2.0}
goals: [{x: 7.0, y: 5.5}]
time_limit: 40.0
"""
NAVIGATION = """
backend: mesh
dist_tolerance: 0.4
angle_tolerance: 3.14
planners:
  - {name: mine, type: "my_planner:MyPlanner"}
  - {name: theirs, type: astar}
controllers: [{name: follower, type: path_follower}]
mesh_map:
  mesh_file: $WORLD_MESH
  inscribed_radius: $ROBOT_INSCRIBED_RADIUS
  default_layer: steep
  layers: [{name: steep, type: steepness}]
"""


@pytest.fixture
def stranger(tmp_path):
    """``stranger("run", ...)`` types ``mbf run ...`` in an empty folder and returns what it printed."""
    environment = {**os.environ, "PYTHONPATH": str(tmp_path / "my_planner")}

    def type_in(*arguments):
        command = [sys.executable, "-c", "from mbf_abstract.cli import main; main()", *arguments]
        done = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stdout + done.stderr
        return done.stdout

    return type_in


def test_from_an_empty_folder_to_a_figure_and_a_table(stranger, tmp_path):
    # 1. A planner of one's own, from a template that works.
    stranger("new", "planner", "my_planner", "--map", "mesh")
    # 2. A robot of one's own: what navigation takes from its URDF.
    wheels = "".join(WHEEL.format(side=side, y=y) for side, y in (("left", 0.2), ("right", -0.2)))
    (tmp_path / "cart.urdf").write_text(ROBOT.format(wheels=wheels))
    assert "differential" in stranger("robot", "show", "cart.urdf")
    # 3. A scenario of one's own, checked before it runs.
    (tmp_path / "navigation.yaml").write_text(NAVIGATION)
    (tmp_path / "my_crossing.yaml").write_text(SCENARIO)
    stranger("check", "my_crossing.yaml")
    assert "SUCCESS" in stranger("run", "my_crossing.yaml", "--out", "first", "--quiet")
    assert (tmp_path / "first" / "replay.html").stat().st_size > 10_000
    # 4. Own planner against a shipped one, ten seeds each.
    printed = stranger("sweep", "my_crossing.yaml", "--seeds", "0:10", "--set", "planner=mine,theirs", "--out", "sweep")
    assert "mine" in printed
    with (tmp_path / "sweep" / "sweep.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert sorted((row["variant"], int(row["seed"])) for row in rows) == [
        (f"planner={planner}", seed) for planner in ("mine", "theirs") for seed in range(10)
    ]
    assert {row["success"] for row in rows} == {"True"}
    # 5. The figures and the table of the paper.
    table = (tmp_path / "sweep" / "sweep.tex").read_text()
    assert table.count(r"\\") >= 3  # the head, and a row for each planner
    assert "planner=mine & 100 &" in table
    assert "planner=theirs & 100 &" in table
    for name in ("boxplots", "tracks"):
        assert (tmp_path / "sweep" / f"{name}.pdf").read_bytes().startswith(b"%PDF-")
        assert (tmp_path / "sweep" / f"{name}.svg").read_text().count("<path") > 20
