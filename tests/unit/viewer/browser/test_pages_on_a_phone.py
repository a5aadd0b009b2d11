"""Pages that are read and not played fit the window of a phone: nothing but a wide table stands out to the side."""

import json

import pytest

from mbf_mesh_nav.building.report import PAGE
from terrain.recording.metrics import measure
from terrain.sweeps.report import write_tables
from terrain.viewer.reports.comparison import comparison_html
from terrain.viewer.reports.report import report_html

LONG = "planner=a_planner_with_a_name_of_more_letters_than_a_phone_has_room_for"
WIDTHS = "[document.documentElement.scrollWidth, window.innerWidth]"


def report(recording, folder):
    metrics = measure(recording).to_json() | {"digest": 64 * "a", "arrivals": [{"estimated_distance_m": 0.1}]}
    (folder / "page.html").write_text(report_html(recording, metrics), encoding="utf-8")


def comparison(recording, folder):
    run = (recording, measure(recording).to_json() | {"digest": 64 * "a"})
    (folder / "page.html").write_text(comparison_html((LONG, LONG + "_too"), (run, run)), encoding="utf-8")


def sweep(recording, folder):
    numbers = {
        "success": True,
        "level": "success",
        "time_s": 10.0,
        "path_length_m": 9.0,
        "verdict": "SUCCESS: goal reached",
    }
    rows = [{"seed": seed, "variant": variant, **numbers} for seed in range(2) for variant in (LONG, LONG + "_too")]
    write_tables("A sweep", rows, folder)
    (folder / "sweep.html").rename(folder / "page.html")


def built_map(recording, folder):
    figure = "<figure><h3>1. Points</h3><img><figcaption>Points of a square metre</figcaption></figure>"
    texts = {"title": "map.ply", "inputs": "From scan.laz", "figures": f"<tr><td>points</td><td>{LONG}</td></tr>"}
    page = PAGE.format(**texts, notes="", plan="", plan_class="", pictures=figure)
    (folder / "page.html").write_text(page, encoding="utf-8")


@pytest.mark.parametrize("write", [report, comparison, sweep, built_map])
def test_a_page_is_as_wide_as_the_phone(chromium, hill_recording, tmp_path, write):
    write(hill_recording, tmp_path)

    async def look(page):
        await page.resize(390, 844)
        await page.open((tmp_path / "page.html").as_uri())
        await page.wait_for("document.readyState === 'complete' && document.querySelector('h1, h2') !== null")
        (tmp_path / "phone.png").write_bytes(await page.screenshot())
        return page.errors, json.loads(await page.evaluate(f"JSON.stringify({WIDTHS})"))

    errors, widths = chromium.visit(look)

    assert errors == [] and widths == [390, 390]
