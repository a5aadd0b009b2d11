"""A replay of a run for any browser: one HTML file that can be opened without network and without Python.

The page draws itself with WebGL 2 from the arrays in it; its scripts are those in the folder ``page``. Poses are kept
at ``FRAME_RATE`` and interpolated by the page, so that files stay small: half a megabyte for a terrain of a quarter of
a million triangles. The same recording gives the same bytes.

Use ``terrain.viewer.pictures.run_picture`` where one look is enough.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from html import escape
from pathlib import Path

from terrain.recording.joint_recording import JointRecording
from terrain.recording.recording import Recording
from terrain.viewer.pictures.colours import FLEET, LEVELS
from terrain.viewer.replay.packing import Packer
from terrain.viewer.replay.run_panel import json_text, legend_of, panel_html
from terrain.viewer.replay.scene_content import PLAIN, Looks, duration, scene_content

PAGE = Path(__file__).resolve().parent / "page"
SCRIPTS = (
    *("maths", "data", "shaders", "drawing", "pace", "camera", "world", "bodies", "lines"),
    *("labels", "panel", "player", "colours", "main"),
)
MOST_NAME = 80  # characters of a name in the title


def replay_html(recording: Recording) -> str:
    """Return a recording as one HTML page."""
    return _page(recording, {PLAIN: recording})


def joint_replay_html(run: JointRecording) -> str:
    """Return the recordings of several robots as one HTML page; as ``replay_html``."""
    looks = [Looks(name, FLEET[number % len(FLEET)]) for number, name in enumerate(run.robots)]
    return _page(run.world, dict(zip(looks, run.robots.values(), strict=True)))


def _page(world: Recording, robots: Mapping[Looks, Recording]) -> str:
    packer = Packer()
    content = scene_content(packer, world, robots)
    content["arrays"] = packer.entries()
    name = f"{world.scenario[:MOST_NAME]} · {world.backend[:MOST_NAME]}"
    legend = legend_of(world, [look for look in robots if look.name])
    texts = {
        "title": escape(f"{name} · {world.verdict.title}"),
        "name": escape(name),
        "colour": LEVELS[world.verdict.level],
        "verdict": escape(str(world.verdict)),
        "duration": f"{duration(robots.values()):.1f}",
        "style": _asset("page.css"),
        "script": "\n".join(_asset(f"{script}.js") for script in SCRIPTS),
        "panel": panel_html(world.events, legend, float(world.times[0]) if len(world.times) else 0.0),
        "scene": json_text(content),
        "arrays": packer.text(),
    }
    return re.sub(r"\{\{(\w+)\}\}", lambda found: texts[found[1]], _asset("page.html"))


def _asset(name: str) -> str:
    return (PAGE / name).read_text("utf-8").rstrip()
