"""A run as a small moving picture (GIF), seen slantwise from above: for READMEs and issues, where no script may run.

For turning, zooming and stopping see ``terrain.viewer.replay``; for full colour and a camera that follows see
``terrain.viewer.pictures.film``.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from PIL import Image

from mbf_abstract.whole_files import replacing
from terrain.recording.recording import Recording
from terrain.viewer.pictures.colours import BODY, DRIVEN, GOAL, PLANNED, SCAN, START
from terrain.viewer.pictures.moving_picture import TEXT, MovingPicture

SIZE = (800, 450)  # pixels
FRAMES = 72
FRAME_TIME, LAST_FRAME_TIME = 90, 2500  # ms
COLOURS = 96
PAINTED = (PLANNED, DRIVEN, START, GOAL, SCAN, BODY, TEXT)
SWATCH = 20  # rows of pixels


def write_animation(file: str | Path, recording: Recording) -> None:
    """Write a recording as GIF."""
    picture = MovingPicture(recording, SIZE)
    moments = np.linspace(0, max(len(recording.times) - 1, 0), FRAMES).astype(int).tolist()
    frames = {index: picture.frame(index, follow=False) for index in dict.fromkeys(moments)}  # short runs repeat some
    palette = _palette(frames[moments[0]])
    few = {index: frame.quantize(palette=palette, dither=Image.Dither.NONE) for index, frame in frames.items()}
    small = [few[index] for index in moments]
    times = [FRAME_TIME] * (len(small) - 1) + [LAST_FRAME_TIME]
    with replacing(file) as part:
        small[0].save(part, save_all=True, append_images=small[1:], duration=times, loop=0, optimize=True)


def _palette(frame: Image.Image) -> Image.Image:
    """The colours of a frame and of everything that is painted over it, which small things would not get otherwise."""
    wide, high = frame.size
    swatches = Image.new("RGB", (wide, high + SWATCH * len(PAINTED)))
    swatches.paste(frame, (0, 0))
    for row, colour in enumerate(PAINTED):
        swatches.paste(colour, (0, high + SWATCH * row, wide, high + SWATCH * (row + 1)))
    return swatches.quantize(COLOURS, dither=Image.Dither.NONE)
