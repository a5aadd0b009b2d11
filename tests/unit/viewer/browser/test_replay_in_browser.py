"""The replay opens from disk in a real browser, without network and without an error, and something is drawn."""

import io
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image

from mbf_abstract.events import Event, EventKind
from terrain.viewer.replay.replay_page import joint_replay_html, replay_html

READY = (
    "window.replay !== undefined && window.replay.used !== undefined && !window.replay.dirty && !window.replay.coarse"
)
DRAWN = "document.querySelector('canvas') !== null && document.querySelector('canvas').clientWidth > 300"


def test_a_replay_opens_from_disk_and_plays(chromium, hill_recording, tmp_path):
    (tmp_path / "replay.html").write_text(replay_html(hill_recording), encoding="utf-8")

    async def watch(page):
        await page.open((tmp_path / "replay.html").as_uri())
        await page.wait_for(DRAWN)
        await page.wait_for("Number(document.querySelector('input').value) > 1.0")  # the time bar moves
        return page.errors, page.requests, await page.screenshot()

    errors, requests, png = chromium.visit(watch)

    (tmp_path / "screenshot.png").write_bytes(png)
    assert errors == []
    assert [url for url in requests if not url.startswith(("file:", "data:", "blob:"))] == []
    pixels = np.asarray(Image.open(io.BytesIO(png)).convert("RGB")).astype(int)
    greenish = (pixels[..., 1] > pixels[..., 2] + 20) & (pixels[..., 1] > pixels[..., 0] - 40)
    assert greenish.mean() > 0.05, "the hills fill a good part of the picture"


def test_a_replay_reports_the_state_of_the_tree_along_its_time_bar(chromium, hill_recording, tmp_path):
    nodes = [{"name": "get there", "type": "Sequence", "depth": 0}, {"name": "plan", "type": "GetPath", "depth": 1}]
    events = [
        Event(0.0, EventKind.TREE, "tree", {"tree": "get there", "nodes": nodes}),
        Event(0.0, EventKind.TREE, "tree", {"tree": "get there", "tick": 1, "changes": [[0, "RUNNING", ""]]}),
        Event(1.0, EventKind.TREE, "tree", {"tree": "get there", "tick": 2, "changes": [[1, "FAILURE", "walled in"]]}),
        *hill_recording.events,
    ]
    (tmp_path / "replay.html").write_text(replay_html(replace(hill_recording, events=tuple(events))), encoding="utf-8")

    async def watch(page):
        await page.open((tmp_path / "replay.html").as_uri())
        await page.read("▶ get there")
        await page.read("✗ plan walled in")
        await page.read("get_path SUCCESS: plan found")
        before = await page.evaluate("replay.player.playing")
        await page.evaluate("document.querySelector('summary').focus()")
        await page.key(" ")
        await page.wait_for("!document.querySelector('details').open")
        await page.evaluate("document.querySelector('#panel-button').focus()")
        await page.key(" ")
        await page.wait_for("document.querySelector('#panel').classList.contains('closed')")
        playing = [before, await page.evaluate("replay.player.playing")]
        return page.errors, playing, await page.screenshot()

    errors, playing, png = chromium.visit(watch)

    (tmp_path / "screenshot.png").write_bytes(png)
    assert errors == []
    assert playing == [True, True], "space presses what has the focus"


def test_a_click_on_an_incident_takes_the_time_bar_to_it(chromium, hill_recording, tmp_path):
    met = {"what": "near_miss", "x": 20.0, "y": 12.0, "z": 1.0, "robot_speed": 1.2}
    met |= {"moved": "both", "other": "person 2", "other_speed": 0.5, "gap": 0.1}
    tipped = {"what": "tipped_over", "x": 30.0, "y": 20.0, "z": 1.0, "robot_speed": 0.0}
    events = [
        *hill_recording.events,
        *(Event(at, EventKind.INCIDENT, "simulator", data) for at, data in ((12.0, met), (25.0, tipped))),
    ]
    (tmp_path / "replay.html").write_text(replay_html(replace(hill_recording, events=tuple(events))), encoding="utf-8")
    marks = "document.querySelectorAll('#run-marks button')"

    async def watch(page):
        await page.open((tmp_path / "replay.html").as_uri())
        await page.wait_for(DRAWN)
        await page.wait_for("window.replay !== undefined")
        await page.key(" ")
        await page.press("✖ 25.0 s  tipped over at (30.0, 20.0), robot 0.00 m/s")
        await page.wait_for("Number(document.querySelector('input').value) === 24.0")
        await page.wait_for(f"{marks}.length === 2 && {marks}[1].style.left !== ''")
        places = await page.evaluate(f"[...{marks}].map(mark => mark.getBoundingClientRect().left)")
        await page.evaluate(f"{marks}[0].click()")
        await page.wait_for("Number(document.querySelector('input').value) === 11.0")
        await page.key("n")
        await page.wait_for("Number(document.querySelector('input').value) === 24.0")
        return page.errors, places, await page.screenshot()

    errors, places, png = chromium.visit(watch)

    (tmp_path / "screenshot.png").write_bytes(png)
    assert errors == []
    assert 0 < places[0] < places[1]


def test_a_roof_does_not_hide_the_robot_under_it_and_all_storeys_can_be_shown(chromium, garage_recording, tmp_path):
    (tmp_path / "replay.html").write_text(replay_html(garage_recording), encoding="utf-8")

    async def watch(page):
        await page.resize(700, 500)
        await page.open((tmp_path / "replay.html").as_uri())
        await page.wait_for("window.replay !== undefined")
        await page.key(" ")
        pictures, states = [], []
        for key in ("1", "2", "]", "]", "]", "3", "?"):
            await page.key(key)
            await page.wait_for(READY)
            states.append(await page.evaluate("[replay.camera.view, replay.storey, replay.used.cut]"))
            pictures.append(np.asarray(Image.open(io.BytesIO(await page.screenshot())).convert("RGB")).astype(int))
        await page.read("next, previous incident")
        return page.errors, pictures, states

    errors, pictures, states = chromium.visit(watch)

    for number, pixels in enumerate(pictures):
        Image.fromarray(pixels.astype(np.uint8)).save(tmp_path / f"screenshot_{number}.png")
    assert errors == []
    assert [state[0] for state in states] == ["overview", "follow", "follow", "follow", "follow", "above", "above"]
    assert [state[1] for state in states[:5]] == ["robot", "robot", "0", "1", "all"]
    cuts = [pytest.approx(1.96), pytest.approx(1.96), 1e9, 1e9]  # 0.7 of a storey of 2.8 m, above the robot's floor
    assert [state[2] for state in states[1:5]] == cuts
    yellow = [((p[..., 0] > 1.1 * p[..., 1]) & (p[..., 1] > 2.2 * p[..., 2])).sum() for p in pictures]
    assert min(yellow[1], yellow[2]) > 200, "the robot is seen under the roof that is cut away"
    assert yellow[4] < yellow[1] / 4, "the roof hides it where all storeys are shown"


def test_controls_of_a_phone_lie_beside_the_scene(chromium, two_robots, tmp_path):
    (tmp_path / "replay.html").write_text(joint_replay_html(two_robots), encoding="utf-8")
    boxes = """['#scene', 'header', 'footer'].map(name => {
      const box = document.querySelector(name).getBoundingClientRect(); return [box.top, box.bottom]; })"""
    rest = """[document.documentElement.scrollWidth,
      [...document.querySelectorAll('.pin b')].map(pin => pin.textContent)]"""

    panel = "document.querySelector('#panel').clientWidth"

    async def watch(page):
        await page.resize(390, 844)
        await page.open((tmp_path / "replay.html").as_uri())
        await page.wait_for("window.replay !== undefined && window.replay.used !== undefined")
        upright = await page.evaluate(boxes), await page.evaluate(rest)
        await page.resize(844, 390)
        await page.open((tmp_path / "replay.html").as_uri() + "?sideways")
        await page.wait_for("window.replay !== undefined && window.replay.used !== undefined")
        closed, sideways = await page.evaluate(panel), await page.evaluate(boxes)
        await page.press("☰")
        opened = await page.evaluate(panel)
        (tmp_path / "sideways.png").write_bytes(await page.screenshot())
        return page.errors, upright, (closed, opened, sideways)

    errors, ((scene, header, footer), (width, names)), (closed, opened, sideways) = chromium.visit(watch)

    assert errors == []
    assert width == 390, "nothing stands out to the side"
    assert header[1] <= scene[0] and scene[1] <= footer[0] and footer[1] <= 844
    assert scene[1] - scene[0] > 0.75 * 844
    assert names == ["a start", "a goal", "b start", "b goal", "a", "b"]
    scene, header, footer = sideways
    assert 15 < header[1] <= scene[0] and scene[1] <= footer[0] and footer[1] <= 390
    assert scene[1] - scene[0] > 0.7 * 390, "the panel is closed until it is wanted, and is beside the scene"
    assert closed == 0 and 200 < opened < 300


def test_a_frame_of_three_hundred_thousand_triangles_stays_within_its_budget(chromium, large_recording, tmp_path):
    page_text = replay_html(large_recording)
    (tmp_path / "replay.html").write_text(page_text, encoding="utf-8")

    async def watch(page):
        await page.resize(320, 240)
        await page.open((tmp_path / "replay.html").as_uri())
        await page.wait_for("window.replay !== undefined")
        await page.key(" ")
        await page.evaluate("replay.player.seek(15)")
        await page.wait_for(READY)
        near = await page.evaluate("replay.used")
        await page.evaluate("replay.camera.zoom(12)")
        await page.wait_for(READY)
        return page.errors, near, await page.evaluate("replay.used")

    errors, near, far = chromium.visit(watch)

    assert errors == []
    assert near["triangles"] > 300_000
    assert near["drawCalls"] <= 13, "shadows, world, sky, hidden robot, discs, bodies, 3 for each of 2 lines, scan"
    assert near["bytes"] < 40e6, "shadows 17 MB; 12 bytes a vertex, 12 a triangle"
    assert far["triangles"] < near["triangles"] / 20, "a coarser level of detail is drawn from afar"
    assert far["drawCalls"] <= near["drawCalls"]
    assert len(page_text) < 2e6


def test_no_chip_covers_the_robot_at_its_start(chromium, office_recording, tmp_path):
    (tmp_path / "replay.html").write_text(replay_html(office_recording), encoding="utf-8")
    robot = """(() => { const {bodies, camera} = window.replay, robot = bodies.robots[0], [x, y, z] = robot.at;
        const high = robot.height * robot.scale;
        return [0.2, 0.5, 0.8, 0.95].map(share => camera.project([x, y, z + share * high])); })()"""
    chips = """[...document.querySelectorAll('.pin b')].map(chip => chip.getBoundingClientRect())
        .map(box => [box.left, box.right, box.top, box.bottom])"""
    canvas = "(box => [box.left, box.top])(document.querySelector('canvas').getBoundingClientRect())"

    async def watch(page):
        await page.open((tmp_path / "replay.html").as_uri())
        await page.wait_for("window.replay !== undefined && window.replay.used !== undefined")
        await page.key(" ")  # stands
        await page.key("Home")
        await page.wait_for("window.replay.player.time < 0.2 && !window.replay.dirty && !window.replay.coarse")
        return await page.evaluate(robot), await page.evaluate(chips), await page.evaluate(canvas)

    places, boxes, (left, top) = chromium.visit(watch)

    assert len(boxes) == 2, "start and goal"
    for x, y in places:
        assert not [box for box in boxes if box[0] < left + x < box[1] and box[2] < top + y < box[3]]
