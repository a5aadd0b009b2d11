"""Makes the pictures and animations of the README from real runs: ``python docs/make_pictures.py``."""

from __future__ import annotations

import tempfile
from pathlib import Path

from PIL import Image

from terrain.recording.recording import Recording
from terrain.scenarios.scenario import load_scenario
from terrain.session.runner import RunOptions, run_scenario
from terrain.viewer.pictures.animation import write_animation
from terrain.viewer.results import write_results

PICTURES = Path(__file__).resolve().parent / "pictures"
WIDTH = 900  # pixels


def make(name: str) -> None:
    """Run a shipped scenario and keep its picture, small, and its animation."""
    with tempfile.TemporaryDirectory() as folder:
        result = run_scenario(load_scenario(name), RunOptions(Path(folder), write_views=write_results))
        if not result.success:
            raise SystemExit(f"{name}: {result.verdict}")
        image = Image.open(Path(folder) / "picture.png").convert("RGB")
        image = image.resize((WIDTH, round(image.height * WIDTH / image.width)), Image.Resampling.LANCZOS)
        image.quantize(128).save(PICTURES / f"{name}.png", optimize=True)
        write_animation(PICTURES / f"{name}.gif", Recording.load(Path(folder) / "recording.npz"))


if __name__ == "__main__":
    PICTURES.mkdir(exist_ok=True)
    for scenario in ("outdoor", "indoor"):
        make(scenario)
