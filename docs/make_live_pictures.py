"""Makes the pictures of the live view in a real browser: ``python docs/make_live_pictures.py [NAME ...]``.

It needs chromium; the browser is driven as in the tests.
"""

from __future__ import annotations

import importlib.util
import io
import queue
import shutil
import sys
import tempfile
import threading
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from types import ModuleType
from typing import Any

from PIL import Image

from terrain.scenarios.scenario import load_scenario
from terrain.session.runner import RunOptions, run_scenario
from terrain.viewer.live.session import LiveSession, ViewOptions

REPOSITORY = Path(__file__).resolve().parents[1]
PICTURES = REPOSITORY / "docs" / "pictures"
SIZE = (1500, 940)  # pixels of the window
WIDTH = 1100  # of the picture
START_TIMEOUT = 300.0  # s until the page is served
CLOSE_NOTES = "document.querySelectorAll('.mantine-Notification-closeButton').forEach(button => button.click())"
FOLLOW = (
    """[...document.querySelectorAll('#mbf-visitor button')].find(button => button.textContent === 'Follow').click()"""
)


@dataclass(frozen=True)
class Shot:
    """What to run, what the page must say before the picture is taken, and what to click before."""

    scenario: str
    when: str
    executive: str = "move_base"
    settings: Mapping[str, str] = field(default_factory=dict)
    clicks: tuple[str, ...] = ()


SHOTS = {
    "live_outdoor": Shot("outdoor", r"/[3-9]\d s · going/", settings={"planner": "cvp"}),
    "live_indoor": Shot("indoor", r"/1[2-9] s · going/", executive="navigation", clicks=(FOLLOW,)),
    "live_people": Shot("crowded_corridor", r"/\b[5-9] s · going/", clicks=(FOLLOW,)),
}


def browser_of_the_tests() -> ModuleType:
    """Load the module that drives Chromium."""
    file = REPOSITORY / "tests" / "unit" / "viewer" / "browser" / "conftest.py"
    spec = importlib.util.spec_from_file_location("browser", file)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def serve(shot: Shot, folder: Path) -> str:
    """Start the run in the background and return the address of its page."""
    addresses: queue.Queue[str] = queue.Queue()
    watch = partial(LiveSession, options=ViewOptions(port=18700), on_page=addresses.put)
    options = RunOptions(folder, executive=shot.executive, settings=shot.settings, watch=watch)
    threading.Thread(target=run_scenario, args=(load_scenario(shot.scenario), options), daemon=True).start()
    return addresses.get(timeout=START_TIMEOUT)


async def photograph(page: Any, shot: Shot, address: str) -> bytes:
    """Open the page, click, wait for the moment, and take the picture."""
    await page.open(address)
    await page.wait_for("document.getElementById('mbf-visitor') !== null")
    await page.wait_for("document.querySelector('canvas') !== null")
    for click in shot.clicks:
        await page.evaluate(click)
    await page.wait_for(f"{shot.when}.test(document.body.innerText)", seconds=300.0)
    await page.evaluate(CLOSE_NOTES)
    await page.wait_for("document.querySelector('.mantine-Notification-root') === null")
    picture: bytes = await page.screenshot()
    return picture


def make(name: str) -> None:
    """Make one of ``SHOTS``."""
    shot, browser = SHOTS[name], browser_of_the_tests()
    browser.FLAGS.append(f"--window-size={SIZE[0]},{SIZE[1]}")
    chromium = browser.Chromium(shutil.which("chromium") or "chromium-browser")
    try:
        with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder:
            address = serve(shot, Path(folder))
            png = chromium.visit(lambda page: photograph(page, shot, address))
    finally:
        chromium.close()
    image = Image.open(io.BytesIO(png)).convert("RGB")
    image = image.resize((WIDTH, round(image.height * WIDTH / image.width)), Image.Resampling.LANCZOS)
    image.quantize(256).save(PICTURES / f"{name}.png", optimize=True)


if __name__ == "__main__":
    for shot_name in sys.argv[1:] or SHOTS:
        make(shot_name)
