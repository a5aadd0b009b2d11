"""The page of ``mbf bridge serve`` in a real browser: it shows map and robot; a click is a goal, which it cancels."""

import io

import pytest
from PIL import Image

from mbf_abstract.access.server_options import ServerOptions
from mbf_abstract.geometry import Pose
from mbf_abstract.server.factory import read_config
from mbf_abstract.testing.loopback import LoopbackSession
from mbf_abstract.time.clock import WallClock
from mbf_ros.rosbridge.serving import BridgeOptions, serve_session

pytestmark = pytest.mark.timeout(300)

CONFIG = """
backend: costmap
max_vel_x: 0.05
global_costmap: {width: 8.0, height: 6.0, layers: [{name: area, type: keepout}], area: {zones: [ZONE]}}
local_costmap: {width: 4.0, height: 4.0, layers: [{name: area, type: keepout}], area: {zones: []}}
planners: [{name: shortest, type: astar}]
controllers: [{name: follow, type: regulated_pure_pursuit}]
"""
ZONE = "{name: spot, polygon: [[3.0, 4.0], [5.0, 4.0], [5.0, 5.0], [3.0, 5.0]]}"


@pytest.fixture
def served(tmp_path):
    """A session with a robot at (1, 1) that creeps, and the address of its page."""
    (tmp_path / "robot.yaml").write_text(CONFIG.replace("ZONE", ZONE))
    session = LoopbackSession(Pose.planar(1.0, 1.0), WallClock())
    with session:
        session.serve(*read_config(tmp_path / "robot.yaml"), session.robot, session.transforms)
        session.navigator.server.warm_up(Pose.planar(1.0, 1.0), Pose.planar(6.0, 1.0))
        with serve_session(session, BridgeOptions(ServerOptions(port=0))) as server:
            yield session, f"http://127.0.0.1:{server.port}/"


def pixel(picture, place):
    return picture.getpixel(tuple(round(value) for value in place))


def test_a_click_is_a_goal_and_cancel_ends_it(chromium, served):
    session, address = served

    async def visit(page):
        await page.open(address)
        await page.wait_for("state.ground !== null && poseOf(frames.robot_frame) !== null")
        blocked, free, goal = [
            await page.evaluate(f"toPixel({{x: {x}, y: {y}}})") for x, y in ((4, 4.5), (4, 2), (6, 1))
        ]
        picture = Image.open(io.BytesIO(await page.screenshot())).convert("RGB")
        await page.click(*goal)
        await page.wait_for("state.plan.length > 2")
        (sent,) = [handle.goal.target_pose for handle in session.navigator.server.move_base.unfinished]
        await page.press("Cancel")
        await page.wait_for("document.getElementById('result').textContent === 'canceled'")
        return picture, (blocked, free), sent, page.errors

    picture, (blocked, free), sent, errors = chromium.visit(visit)
    assert errors == []
    assert max(pixel(picture, blocked)) < 90 and min(pixel(picture, free)) > 230
    assert sent.distance_to(Pose.planar(6.0, 1.0)) < 0.05
    assert session.robot.command.is_stopped()
