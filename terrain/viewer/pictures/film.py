"""A run as a film (MP4, H.264) in full colour that alternates an overview and a camera behind the robot.

It needs PyAV (extra ``video``). The same recording gives the same bytes with the same PyAV.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from mbf_abstract.whole_files import replacing
from terrain.recording.recording import Recording
from terrain.viewer.pictures.moving_picture import MovingPicture
from terrain.viewer.pictures.picture import ViewerMissing

SIZE = (960, 540)  # pixels
FRAME_RATE = 25  # Hz
LONGEST = 20.0  # s; longer runs are played faster
LEAST = 1.0  # s
SHOTS = ((False, 4.0), (True, 6.0))  # whether the camera follows, for so many seconds; again and again
ENDING = 2.0  # s of overview with the outcome
QUALITY = "21"  # constant rate factor of x264


def write_film(file: str | Path, recording: Recording, size: tuple[int, int] = SIZE) -> None:
    """Write a recording as MP4 of an even width and height [pixels]; raises ViewerMissing without PyAV."""
    try:
        import av
    except ImportError as error:
        raise ViewerMissing(f"films need PyAV: pip install 'mbf-flex[video]' ({error})") from error
    picture = MovingPicture(recording, size)
    with replacing(file) as part, av.open(str(part), "w", format="mp4") as container:
        options = {"crf": QUALITY, "threads": "1"}  # several threads need not give the same bytes
        stream: Any = container.add_stream("libx264", rate=FRAME_RATE, options=options)
        stream.width, stream.height, stream.pix_fmt = *size, "yuv420p"
        for index, follow in shots(recording):
            frame = av.VideoFrame.from_ndarray(np.asarray(picture.frame(index, follow)), format="rgb24")
            container.mux(stream.encode(frame))
        container.mux(stream.encode())


def shots(recording: Recording) -> Iterator[tuple[int, bool]]:
    """Index of the sample, and whether the camera follows, of each frame."""
    last = len(recording.times) - 1
    length = min(max(recording.duration, LEAST), LONGEST)
    count = round(length * FRAME_RATE)
    begins = np.cumsum([0.0, *(seconds for _, seconds in SHOTS)])
    for number in range(count):
        shot = int(np.searchsorted(begins, number / FRAME_RATE % begins[-1], side="right")) - 1
        now = recording.duration * number / count
        index = int(np.searchsorted(recording.times, recording.times[0] + now, side="right")) - 1 if last > 0 else 0
        yield max(index, 0), SHOTS[shot][0] and last > 0
    for _ in range(round(ENDING * FRAME_RATE)):
        yield max(last, 0), False
