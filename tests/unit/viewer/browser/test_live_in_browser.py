"""``mbf run --view`` in a real browser: the page shows the run, takes goals by a click, pauses, cancels and ends it."""

import io
import json
import subprocess
import sys

import numpy as np
import pytest
import yaml
from PIL import Image

import terrain
from mbf_abstract.event_sinks import read_events
from mbf_abstract.events import EventKind

pytestmark = pytest.mark.timeout(300)

CONFIG = f"{terrain.__path__[0]}/scenarios/library/config/outdoor_mesh.yaml"
SCENARIO = {
    "name": "meadow",
    "proves": "A page can be used.",
    "backend": "mesh",
    "navigation": {"mesh": CONFIG},
    "world": {"type": "generated", "size": [12.0, 10.0], "median_slope": 5.0},
    "robot": "husky",
    "start": {"x": 3.0, "y": 5.0},
    "goals": [{"x": 9.0, "y": 5.0}],
    "sensors": [{"name": "lidar", "rays": 90}],
    "actors": [{"type": "walker", "route": [[6.0, 7.0], [6.5, 7.0]], "speed": 0.1}],
}
SPEED = "0.1"  # of real time: however slow the browser is, the robot is still under way when the page asks for more
COSTMAP = {  # the same on cells
    "backend": "costmap",
    "navigation": {"costmap": CONFIG.replace("outdoor_mesh", "outdoor_costmap")},
}
VALUES = "document.getElementById('mbf-values').innerText"
STICK = "document.getElementById('mbf-stick').parentElement.innerText"
CANVAS = "document.querySelector('canvas')"
STICK_AND_SHEET = (  # the gap between both [pixels]
    "document.querySelector('[data-mbf-sheet]').getBoundingClientRect().top"
    " - document.querySelector('#mbf-stick').getBoundingClientRect().bottom"
)
PLACE = f"(() => {{ const r = {CANVAS}.getBoundingClientRect(); return [r.x + r.width / 2, r.y + r.height / 2]; }})()"

DISABLED = """(() => {
  const label = e => e.innerText ? e.innerText.trim() : label(e.parentElement);
  return [...document.querySelectorAll('input[type=checkbox]:disabled')].map(label);
})()"""


@pytest.fixture
def served_run(tmp_path, request):
    """Start ``mbf run --view`` on open ground; returns the process, the page's address and the folder of results.

    The parameter is further options, or what the scenario has otherwise.
    """
    parameter = getattr(request, "param", ())
    changes, more = (parameter, ()) if isinstance(parameter, dict) else ({}, parameter)
    (tmp_path / "meadow.yaml").write_text(yaml.safe_dump({**SCENARIO, **changes}))
    start = [sys.executable, "-c", "from mbf_abstract.cli import main; main()", "run", tmp_path / "meadow.yaml"]
    options = ["--out", tmp_path / "run", "--json", "--executive", "navigation"]
    view = ["--view", "--view-port", "18400", "--view-speed", SPEED, *more]
    process = subprocess.Popen([*start, *options, *view], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    for line in process.stderr:
        if "live view at " in line:
            yield process, line.split()[-1], tmp_path / "run"
            break
    else:
        pytest.fail("no page was served")
    process.kill()
    process.communicate()


def test_the_page_shows_the_run_and_steers_it(chromium, served_run, tmp_path):
    process, address, folder = served_run

    async def steer(page):
        await page.open(address)
        await page.read("▶ follow path")  # the tree at work
        await page.wait_for(f"{CANVAS} !== null && {CANVAS}.clientWidth > 300")
        await page.click(*await page.evaluate(PLACE))
        await page.read("what: new goal")
        await page.read("going to ")
        await page.press("Pause")
        await page.read("paused")
        png = await page.screenshot()
        await page.press("Resume")
        await page.press("Cancel")
        await page.read("CANCELED: canceled in the live view")
        await page.press("End the run")
        errors = list(page.errors)
        await page.read("The run has ended")
        return errors, png

    errors, png = chromium.visit(steer)
    answer = json.loads(process.stdout.read())

    (tmp_path / "live_view.png").write_bytes(png)
    assert errors == []
    assert_the_log_holds_what_was_asked_for(list(read_events(folder / "events.jsonl")))
    assert answer["outcome"] == "CANCELED"
    assert (folder / "replay.html").is_file()
    assert_the_ground_and_the_person_are_seen(png)


@pytest.mark.parametrize("served_run", [["--view-read-only"]], indirect=True)
def test_a_page_for_watching_only_shows_the_run_without_a_button_that_could_be_pressed(chromium, served_run):
    address = served_run[1]

    async def watch(page):
        await page.open(address)
        await page.read("▶ follow path")
        await page.read("lidar")  # the last control of the page that steers nothing
        await page.press("Overview")  # everybody chooses the own view
        text = await page.evaluate("document.body.innerText")
        disabled = await page.evaluate(DISABLED)
        return page.errors, text, disabled

    errors, text, disabled = chromium.visit(watch)

    assert "Watching only" in text
    assert errors == [] and "lidar" in disabled
    steering = ("Cancel", "Pause", "End the run", "Inject", "a click is", "Waypoints", "WASD", "Place")
    assert not [word for word in steering if word in text]


def test_on_a_phone_the_scene_is_free_and_the_controls_open_below_it(chromium, served_run, tmp_path):
    address = served_run[1]
    edges = """['#mbf-stick', '[data-mbf-sheet]'].map(name => {
      const box = document.querySelector(name).getBoundingClientRect(); return [box.top, box.bottom, box.width]; })"""
    sheet = "document.querySelector('[data-mbf-sheet]')"

    async def look(page):
        await page.resize(390, 844)
        await page.open(address)
        await page.wait_for(f"{sheet} !== null && {sheet}.offsetHeight < 100")
        await page.wait_for("document.querySelector('#mbf-stick') !== null")
        await page.wait_for(f"{STICK_AND_SHEET} > 0")
        folded = await page.evaluate(edges)
        (tmp_path / "phone.png").write_bytes(await page.screenshot())
        await page.click(300, 820)
        await page.wait_for(f"{sheet}.offsetHeight > 300 && {STICK_AND_SHEET} > 0")
        await page.read("Hide controls")
        opened = await page.evaluate(edges)
        await page.resize(844, 390)  # held sideways it is as a desktop, and folded again when upright
        await page.wait_for(f"{sheet} === null")
        await page.resize(390, 844)
        await page.wait_for(f"{sheet} !== null && {sheet}.offsetHeight < 100")
        return page.errors, folded, opened

    errors, folded, opened = chromium.visit(look)

    assert errors == []
    assert folded[1][0] > 0.9 * 844 and folded[1][2] == 390, "the sheet is a bar along the lower edge"
    assert folded[0][1] < folded[1][0], "nothing covers the stick"
    assert opened[1][0] >= 0.5 * 844 - 1 and opened[0][1] < opened[1][0]


@pytest.mark.parametrize("served_run", [COSTMAP], ids=["costmap"], indirect=True)
def test_a_drag_is_a_goal_with_a_heading_waypoints_are_driven_and_the_stick_drives_while_it_is_held(
    chromium, served_run, tmp_path
):
    process, address, folder = served_run

    async def steer(page):
        await page.open(address)
        await page.wait_for(f"{CANVAS} !== null && {CANVAS}.clientWidth > 300")
        await page.read("WASD")
        await page.press("Pause")  # so that the robot reaches nothing, however slow the browser is
        x, y = await page.evaluate(PLACE)
        await page.drag((x, y), (x + 60, y), modifiers=8)
        await page.read("what: new goal")
        await page.wait_for(f"{VALUES}.includes('inflation')")  # a layer, after the map's next update
        values = await page.evaluate(VALUES)
        await page.choose("a click is", "a waypoint")
        await page.move(x, y)
        await page.wait_for(f"/a click is\\s*a waypoint/.test({VALUES})")  # the choice has come to the run
        await page.click(x, y)
        await page.drag((x - 80, y + 60), (x - 80, y), modifiers=8)
        await page.read("· 2: ")
        await page.press("Drive the waypoints")
        await page.read("▶ 1: ")
        await page.press("Tree")
        await page.wait_for("document.querySelector('#mbf-tree svg') !== null")
        png = await page.screenshot()
        await page.press("Resume")
        await page.key_down(" ", "Space")
        await page.key_down("w", "KeyW")
        await page.wait_for(f"{STICK}.includes('driving')")
        await page.read("what: teleoperation")
        await page.key_up(" ", "Space")
        await page.read("what: end of teleoperation")
        await page.wait_for(f"{STICK}.includes('WASD')")
        await page.press("Follow")
        await page.press("End the run")
        return page.errors, values, png

    errors, values, png = chromium.visit(steer)
    process.stdout.read()

    (tmp_path / "by_hand.png").write_bytes(png)
    assert errors == []
    assert "place" in values and "global_costmap" in values and "local_costmap" in values
    assert_the_log_holds_what_was_done_by_hand(list(read_events(folder / "events.jsonl")))


def assert_the_log_holds_what_was_done_by_hand(events):
    asked = {event.data["what"]: event.data for event in events if event.source == "live_view"}
    assert {"new goal", "drive waypoints", "teleoperation", "end of teleoperation", "end"} <= set(asked)
    assert asked["drive waypoints"]["waypoints"] == 2
    held = [event.kind for event in events if event.data.get("holder") == "teleoperation"]
    assert held[0] is EventKind.LEASE_GRANTED and EventKind.LEASE_REVOKED in held
    ended = [
        event.data for event in events if event.kind is EventKind.GOAL_FINISHED and event.source == "follow_waypoints"
    ]
    assert [data["message"] for data in ended] == ["teleoperation in the live view"]


def assert_the_log_holds_what_was_asked_for(events):
    asked = [event for event in events if event.source == "live_view"]
    assert [event.data["what"] for event in asked] == ["new goal", "pause", "resume", "cancel", "end"]
    assert 0.0 < asked[0].data["x"] < 12.0 and 0.0 < asked[0].data["y"] < 10.0
    begun = [event.time for event in events if event.kind is EventKind.TREE and "nodes" in event.data]
    assert len(begun) == 2 and begun[1] >= asked[0].time
    paused = [event.time for event in events if event.kind is EventKind.GOAL_PAUSED]
    assert asked[1].time <= paused[0] < asked[2].time


def assert_the_ground_and_the_person_are_seen(png):
    pixels = np.asarray(Image.open(io.BytesIO(png)).convert("RGB")).astype(int)
    greenish = (pixels[..., 1] > pixels[..., 2] + 20) & (pixels[..., 1] > pixels[..., 0] - 40)
    assert greenish.mean() > 0.05, "green ground fills a good part of the picture"
    violet = (pixels[..., 0] > pixels[..., 1] + 50) & (pixels[..., 2] > pixels[..., 0] + 10)
    assert violet.mean() > 0.001, "somebody stands there"
