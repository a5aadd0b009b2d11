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
from mbf_ros.rosbridge_robot.simulated_robot import serve_robot

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
        assert await page.evaluate("state.plan.length") == 0
        return picture, (blocked, free), sent, page.errors

    picture, (blocked, free), sent, errors = chromium.visit(visit)
    assert errors == []
    assert max(pixel(picture, blocked)) < 90 and min(pixel(picture, free)) > 230
    assert sent.distance_to(Pose.planar(6.0, 1.0)) < 0.05
    assert session.robot.command.is_stopped()


READY = "state.ground !== null && poseOf(frames.robot_frame) !== null"
SEEN = "[view.x, view.y, view.scale]"
GOAL = "document.getElementById('goal').textContent"


async def pixels(page, *places):
    return [await page.evaluate(f"toPixel({{x: {x}, y: {y}}})") for x, y in places]


async def finger_pans(page, here, there):
    await page.touch("touchStart", here)
    await page.touch("touchMove", there)
    await page.touch("touchEnd")


async def fingers_pinch(page, here, there):
    middle = [(a + b) / 2 for a, b in zip(here, there, strict=True)]
    await page.touch("touchStart", middle)
    await page.touch("touchStart", middle, there)
    await page.touch("touchMove", here, there)
    await page.touch("touchEnd")


async def mouse_pans(page, here, there):
    await page.drag(here, there)


async def wheel_zooms(page, here, there):
    await page.command("Input.dispatchMouseEvent", type="mouseWheel", x=here[0], y=here[1], deltaX=0, deltaY=-200)


async def keys_move(page, here, there):
    await page.evaluate("canvas.focus()")
    for key in ("ArrowLeft", "+"):
        await page.key(key)


async def finger_is_taken_away(page, here, there):
    await finger_pans(page, here, there)
    await page.touch("touchStart", here)
    cancel = "new PointerEvent('pointercancel', { pointerId: [...pointers.keys()][0] })"
    assert not await page.evaluate(f"canvas.dispatchEvent({cancel}) && gesture !== null")
    await page.touch("touchEnd")


@pytest.mark.parametrize("move", [finger_pans, fingers_pinch, mouse_pans, wheel_zooms, keys_move, finger_is_taken_away])
def test_who_moves_the_view_sends_the_robot_nowhere(chromium, served, move):
    session, address = served

    async def visit(page):
        await page.resize(390, 844)
        await page.open(address)
        await page.wait_for(READY)
        before = await page.evaluate(SEEN)
        await move(page, *await pixels(page, (3, 2), (5, 3)))
        await page.wait_for(f"JSON.stringify({SEEN}) !== '{str(before).replace(' ', '')}'")
        return await page.evaluate(GOAL), page.errors

    assert chromium.visit(visit) == ("none", [])
    assert session.navigator.server.move_base.unfinished == []


def test_a_tap_is_a_goal_and_a_finger_that_rests_gives_it_a_heading(chromium, served):
    _, address = served

    async def visit(page):
        await page.resize(390, 844)
        await page.open(address)
        await page.wait_for(READY)
        here, above = await pixels(page, (5, 2), (5, 4))
        await page.touch("touchStart", here)
        await page.touch("touchEnd")
        await page.wait_for(f"{GOAL} !== 'none'")
        tapped = await page.evaluate("[state.goal.x, state.goal.y, state.goal.yaw]")
        await page.touch("touchStart", here)
        await page.wait_for("aimedGoal() !== null")
        await page.touch("touchMove", above)
        await page.touch("touchEnd")
        await page.wait_for("goalId !== null && aimedGoal() === null")
        return tapped, await page.evaluate("[state.goal.x, state.goal.y, state.goal.yaw]")

    tapped, aimed = chromium.visit(visit)
    assert tapped == pytest.approx([5.0, 2.0, 0.245], abs=0.05)  # on from the robot at (1, 1)
    assert aimed == pytest.approx([5.0, 2.0, 1.571], abs=0.05)


def test_the_map_is_beside_the_panel_of_a_phone(chromium, served):
    _, address = served

    async def visit(page):
        await page.resize(390, 844)
        await page.open(address)
        await page.wait_for(READY)
        corners = await pixels(page, (0, 0), (8, 6))
        return corners, await page.evaluate("document.getElementById('panel').getBoundingClientRect().top")

    ((left, bottom), (right, top)), panel = chromium.visit(visit)
    assert 0 <= left < right <= 390 and 0 <= top < bottom <= panel


def test_a_robot_without_a_navigator_says_that_it_cannot_pause(chromium, served):
    session, _ = served
    with serve_robot(session, BridgeOptions(ServerOptions(port=0))) as server:

        async def visit(page):
            await page.open(f"http://127.0.0.1:{server.port}/")
            await page.wait_for("document.getElementById('connection').textContent === 'connected'")
            await page.press("Pause")
            await page.read("/move_base_flex/pause")
            return page.errors

        assert chromium.visit(visit) == []
