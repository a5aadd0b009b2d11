"""Makes pictures, animations and the embedded replay of README and documentation from real runs.

``python docs/make_pictures.py`` makes all of them, ``python docs/make_pictures.py garage_roof`` those of one scenario.
"""

from __future__ import annotations

import io
import shutil
import sys
import tempfile
from pathlib import Path

from PIL import Image

from terrain.recording.recording import Recording
from terrain.scenarios.scenario import load_scenario
from terrain.session.runner import RunOptions, run_scenario
from terrain.viewer.pictures.animation import write_animation
from terrain.viewer.pictures.film import FRAME_RATE, shots
from terrain.viewer.pictures.layer_picture import has_layers, layer_picture_png
from terrain.viewer.pictures.moving_picture import MovingPicture
from terrain.viewer.results import write_results

DOCS = Path(__file__).resolve().parent
PICTURED, REPLAYED, LANDING = ("outdoor", "indoor"), ("garage_roof",), "outdoor"
COSTS = ("steepness", "roughness", "height_diff", "tilt")
WIDTH = 900  # pixels
FILM_SIZE, FILM_STEP = (640, 360), 4  # pixels, and which of the film's frames are in the landing animation
FILM_QUALITY = 50  # of 100


def make_small(picture: Path | io.BytesIO, file: Path) -> None:
    """Keep a picture in 128 colours and ``WIDTH`` pixels."""
    image = Image.open(picture).convert("RGB")
    image = image.resize((WIDTH, round(image.height * WIDTH / image.width)), Image.Resampling.LANCZOS)
    # The default method gives hills all colours: the plan would be no longer blue there, the goal no longer red.
    image.quantize(128, Image.Quantize.MAXCOVERAGE).save(file, optimize=True)


def make_landing(recording: Recording, file: Path) -> None:
    """Write the film of a run, overview and follow camera by turns, in full colour, as READMEs show it."""
    picture = MovingPicture(recording, FILM_SIZE)
    frames = [picture.frame(index, follow) for index, follow in list(shots(recording))[::FILM_STEP]]
    period = round(1000 * FILM_STEP / FRAME_RATE)
    frames[0].save(
        file, save_all=True, append_images=frames[1:], duration=period, loop=0, quality=FILM_QUALITY, method=6
    )


def make(name: str) -> None:
    """Run a shipped scenario and keep its picture, small, with its costs and animation, or its replay."""
    with tempfile.TemporaryDirectory() as folder:
        result = run_scenario(load_scenario(name), RunOptions(Path(folder), write_views=write_results))
        if not result.success:
            raise SystemExit(f"{name}: {result.verdict}")
        if name in REPLAYED:
            shutil.copy(Path(folder) / "replay.html", DOCS / "replays" / f"{name}.html")
        else:
            make_small(Path(folder) / "picture.png", DOCS / "pictures" / f"{name}.png")
            recording = Recording.load(Path(folder) / "recording.npz")
            if name == LANDING:
                make_landing(recording, DOCS / "pictures" / f"{name}.webp")
            else:
                write_animation(DOCS / "pictures" / f"{name}.gif", recording)
            if has_layers(recording):
                make_small(io.BytesIO(layer_picture_png(recording, COSTS)), DOCS / "pictures" / f"{name}_costs.png")


if __name__ == "__main__":
    for scenario in sys.argv[1:] or (*PICTURED, *REPLAYED):
        make(scenario)
