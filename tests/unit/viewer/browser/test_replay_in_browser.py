"""The replay opens from disk in a real browser, without network and without an error, and something is drawn."""

import asyncio
import io
from dataclasses import replace

import numpy as np
from PIL import Image

from mbf_abstract.events import Event, EventKind
from terrain.viewer.replay import replay_html

DRAWN = "document.querySelector('canvas') !== null && document.querySelector('canvas').clientWidth > 300"


def test_a_replay_opens_from_disk_and_plays(chromium, hill_recording, tmp_path):
    (tmp_path / "replay.html").write_text(replay_html(hill_recording), encoding="utf-8")

    async def watch(page):
        await page.open((tmp_path / "replay.html").as_uri())
        await page.wait_for(DRAWN)
        await page.wait_for("Number(document.querySelector('input').value) > 1.0")  # the time bar moves
        await asyncio.sleep(1.0)
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
        return page.errors, await page.screenshot()

    errors, png = chromium.visit(watch)

    (tmp_path / "screenshot.png").write_bytes(png)
    assert errors == []


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
        await page.press("25.0 s  tipped over at (30.0, 20.0), robot 0.00 m/s")
        await page.wait_for("document.querySelector('input').value === '24.0'")
        await page.wait_for(f"{marks}.length === 2 && {marks}[1].style.left !== ''")
        places = await page.evaluate(f"[...{marks}].map(mark => mark.getBoundingClientRect().left)")
        await page.evaluate(f"{marks}[0].click()")
        await page.wait_for("document.querySelector('input').value === '11.0'")
        return page.errors, places, await page.screenshot()

    errors, places, png = chromium.visit(watch)

    (tmp_path / "screenshot.png").write_bytes(png)
    assert errors == []
    assert 0 < places[0] < places[1]
