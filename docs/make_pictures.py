"""Makes pictures, animations and the embedded replay of README and documentation from real runs.

``python docs/make_pictures.py`` makes all of them, ``python docs/make_pictures.py garage_roof`` those of one scenario.
"""

from __future__ import annotations

import shutil
import sys
import tempfile
from pathlib import Path

from PIL import Image

from terrain.recording.recording import Recording
from terrain.scenarios.scenario import load_scenario
from terrain.session.runner import RunOptions, run_scenario
from terrain.viewer.pictures.animation import write_animation
from terrain.viewer.results import write_results

DOCS = Path(__file__).resolve().parent
PICTURED, REPLAYED = ("outdoor", "indoor"), ("garage_roof",)
WIDTH = 900  # pixels


def make(name: str) -> None:
    """Run a shipped scenario and keep its picture, small, and its animation, or its replay."""
    with tempfile.TemporaryDirectory() as folder:
        result = run_scenario(load_scenario(name), RunOptions(Path(folder), write_views=write_results))
        if not result.success:
            raise SystemExit(f"{name}: {result.verdict}")
        if name in REPLAYED:
            shutil.copy(Path(folder) / "replay.html", DOCS / "replays" / f"{name}.html")
        else:
            image = Image.open(Path(folder) / "picture.png").convert("RGB")
            image = image.resize((WIDTH, round(image.height * WIDTH / image.width)), Image.Resampling.LANCZOS)
            image.quantize(128).save(DOCS / "pictures" / f"{name}.png", optimize=True)
            write_animation(DOCS / "pictures" / f"{name}.gif", Recording.load(Path(folder) / "recording.npz"))


if __name__ == "__main__":
    for scenario in sys.argv[1:] or (*PICTURED, *REPLAYED):
        make(scenario)
