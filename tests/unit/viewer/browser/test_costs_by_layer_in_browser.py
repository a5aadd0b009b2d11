"""The replay colours the ground by the costs of a layer that is chosen, and says which and in what unit."""

import io
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image

from terrain.recording.recorded_maps import RecordedLayer, RecordedMesh
from terrain.viewer.pictures.colours import WALL
from terrain.viewer.replay.replay_page import replay_html

READY = (
    "window.replay !== undefined && window.replay.used !== undefined && !window.replay.dirty && !window.replay.coarse"
)


@pytest.fixture
def with_layers(hill_recording):
    """The hills with a layer that forbids their eastern half and one that costs more to the north."""
    ground = hill_recording.ground
    x, y, _ = ground.vertices.T
    middle = 0.5 * (x.min() + x.max())
    closed = RecordedLayer("east", np.where(x > middle, np.inf, 0.0).astype(np.float16))
    north = RecordedLayer("steepness", (y / y.max()).astype(np.float16), "rad")
    mesh = RecordedMesh(0.0, ground.vertices, ground.faces, closed.costs)
    return replace(hill_recording, meshes=[mesh], layers=[closed, north])


def test_the_ground_has_the_colours_of_the_layer_that_is_chosen_with_a_legend(chromium, with_layers, tmp_path):
    (tmp_path / "replay.html").write_text(replay_html(with_layers), encoding="utf-8")
    legend = "document.getElementById('cost-legend')"

    async def watch(page):
        await page.open((tmp_path / "replay.html").as_uri())
        await page.wait_for("window.replay !== undefined")
        pictures, legends = [], []
        for key in (" ", "3", "c", "c", "c"):
            await page.key(key)
            await page.wait_for(READY)
            pictures.append(np.asarray(Image.open(io.BytesIO(await page.screenshot())).convert("RGB")).astype(int))
            legends.append(await page.evaluate(f"{legend}.hidden ? null : {legend}.innerText.split('\\n').join(' ')"))
        choices = await page.evaluate("[...document.getElementById('colours').options].map(one => one.text)")
        return page.errors, choices, legends, pictures

    errors, choices, legends, pictures = chromium.visit(watch)

    for number, pixels in enumerate(pictures):
        Image.fromarray(pixels.astype(np.uint8)).save(tmp_path / f"screenshot_{number}.png")
    assert errors == []
    assert choices == ["slopes", "costs: east", "costs: steepness"]
    assert legends[1] is None and legends[4] is None
    assert legends[2].split() == "east 0 to 1 forbidden not on the map".split()
    assert "0 to 1 rad" in legends[3]
    scenes = [pixels[60:700, 20:960] for pixels in pictures]
    dark = [(np.abs(one - WALL).max(axis=2) < 45).mean(axis=0) for one in scenes]
    half = dark[2].size // 2
    assert dark[2][half + 60 :].mean() > 0.4 > 0.05 > max(dark[2][: half - 60].mean(), dark[1].mean(), dark[3].mean())
    assert dark[4].mean() < 0.05, "slopes are back"
    redder = (scenes[3][..., 0] - scenes[3][..., 1])[:, 200:780].mean(axis=1)
    assert redder[100:200].mean() > redder[400:500].mean() + 40.0, "it costs more to the north"


def test_a_run_without_layers_offers_no_colours(chromium, hill_recording, tmp_path):
    (tmp_path / "replay.html").write_text(replay_html(hill_recording), encoding="utf-8")

    async def watch(page):
        await page.open((tmp_path / "replay.html").as_uri())
        await page.wait_for(READY.replace("!window.replay.dirty && !window.replay.coarse", "true"))
        await page.key("c")
        return page.errors, await page.evaluate(
            "document.getElementById('colours').hidden && replay.world.looks.steps === 0"
        )

    assert chromium.visit(watch) == ([], True)
