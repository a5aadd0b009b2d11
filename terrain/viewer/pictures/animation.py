"""A run as a small moving picture (GIF), seen slantwise from above: for READMEs and issues, where no script may run.

The world is painted once, far faces first; plan, track, scan and robot are painted over it, frame by frame. For
turning, zooming and stopping see ``terrain.viewer.replay``.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont
from trimesh.remesh import subdivide_to_size

from mbf_abstract.geometry import FloatArray, Pose
from mbf_abstract.whole_files import replacing
from terrain.recording.recording import Recording
from terrain.viewer.pictures.colours import BODY, DRIVEN, GOAL, PLANNED, SCAN, START, Colour
from terrain.viewer.pictures.shading import lit_colours
from terrain.viewer.pictures.shapes import marks, prism, standing_things
from terrain.viewer.scene import look_at_route
from terrain.worlds.surface import NO_SURFACE, Surface, joined

SIZE = (800, 450)  # pixels
FRAMES = 72
FRAME_TIME, LAST_FRAME_TIME = 90, 2500  # ms
SMOOTHING = 2  # the world is drawn so many times as large
LARGEST_FACE = 1.0  # m; longer edges are cut, so that faces can be ordered by their middles
SKY = (232, 238, 244)
COLOURS = 96
LEAST_ROBOT = 0.024  # of the picture's width; smaller robots are drawn larger than they are
MARK = 6  # pixels
ZOOM = 1.3  # the replay's first view leaves room for its buttons
TEXT: Colour = (30, 30, 30)
PAINTED = (PLANNED, DRIVEN, START, GOAL, SCAN, BODY, TEXT)
SWATCH = 20  # rows of pixels


def write_animation(file: str | Path, recording: Recording) -> None:
    """Write a recording as GIF."""
    frames = list(_frames(recording))
    palette = _palette(frames[0])
    small = [frame.quantize(palette=palette, dither=Image.Dither.NONE) for frame in frames]
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


class Camera:
    """A pinhole camera that looks at the whole route.

    Parameters
    ----------
    recording : Recording
    size : (width, height)
        Of the picture [pixels].
    """

    def __init__(self, recording: Recording, size: tuple[int, int]) -> None:
        wanted = SimpleNamespace()
        look_at_route(wanted, recording)
        self.position = np.array(wanted.position, dtype=np.float64)
        forward = np.array(wanted.look_at) - self.position
        forward = forward / np.linalg.norm(forward)
        right = np.cross(forward, [0.0, 0.0, 1.0])
        right = right / np.linalg.norm(right)
        self._axes = np.stack([right, np.cross(forward, right), forward])  # right, down, forward
        self._size = size
        self._focal = ZOOM * 0.5 * size[1] / np.tan(0.5 * wanted.fov)

    def project(self, points: FloatArray) -> FloatArray:
        """Pixels (n, 2) of points (n, 3) [m] in front of the camera."""
        right, down, ahead = ((points - self.position) @ self._axes.T).T
        scale = self._focal / np.maximum(ahead, 1e-3)
        return np.column_stack([0.5 * self._size[0] + scale * right, 0.5 * self._size[1] + scale * down])

    def pixels_per_metre(self, point: FloatArray) -> float:
        """Size of a metre at a point (3,) [m]."""
        return float(self._focal / max(float((point - self.position) @ self._axes[2]), 1e-3))


def draw_world(recording: Recording) -> Image.Image:
    """Draw what does not move, with smooth edges."""
    fine = SMOOTHING * SIZE[0], SMOOTHING * SIZE[1]
    image = Image.new("RGB", fine, SKY)
    parts: list[tuple[Surface, Colour | None, float]] = [
        (surface, paint, LARGEST_FACE) for _, surface, paint in standing_things(recording)
    ]
    if recording.ground is not None:
        parts.insert(0, (recording.ground, None, 0.0))
    surfaces, colours, nearer = [NO_SURFACE], [np.zeros((0, 3))], [np.zeros(0)]
    for surface, paint, lead in parts:
        if len(surface.faces):
            small, of_face = _cut_small(surface)
            surfaces.append(small)
            colours.append(lit_colours(surface, paint)[of_face])
            nearer.append(np.full(len(of_face), lead))
    painter, camera = ImageDraw.Draw(image), Camera(recording, fine)
    _paint_faces(painter, camera, joined(surfaces), np.concatenate(colours), np.concatenate(nearer))
    return image.resize(SIZE, Image.Resampling.BOX)


def _cut_small(surface: Surface) -> tuple[Surface, NDArray[np.intp]]:
    """Cut faces until no edge is longer than ``LARGEST_FACE``; each with the index of the face that it is a part of."""
    vertices, faces, of_face = subdivide_to_size(*surface, LARGEST_FACE, max_iter=20, return_index=True)
    return Surface(vertices, faces), of_face


def _paint_faces(
    painter: ImageDraw.ImageDraw,
    camera: Camera,
    surface: Surface,
    colours: FloatArray,
    nearer: FloatArray | float = 0.0,
) -> None:
    """Paint faces in colours (F, 3), far ones first; each counts as ``nearer`` [m] than it is."""
    corners = surface.vertices[surface.faces]
    distances = np.linalg.norm(corners.mean(axis=1) - camera.position, axis=1) - nearer
    pixels = camera.project(surface.vertices)[surface.faces].reshape(-1, 6).tolist()
    fills = list(map(tuple, colours.astype(int).tolist()))
    for face in np.argsort(-distances, kind="stable").tolist():
        painter.polygon(pixels[face], fill=fills[face])


def _frames(recording: Recording) -> Iterator[Image.Image]:
    camera = Camera(recording, SIZE)
    world = draw_world(recording)
    for index in np.linspace(0, max(len(recording.times) - 1, 0), FRAMES).astype(int).tolist():
        frame = world.copy()
        painter = ImageDraw.Draw(frame)
        for _, pose, colour in marks(recording):
            _disc(painter, camera.project(np.array([pose.position]))[0], MARK, colour)
        if len(recording.times):
            _paint_moment(painter, camera, recording, index)
        yield frame


def _paint_moment(painter: ImageDraw.ImageDraw, camera: Camera, recording: Recording, index: int) -> None:
    """Plan and scan at that time, the track until then, the robot and its status."""
    now = float(recording.times[index])
    for points, colour, width in (
        (next((path for time, path in reversed(recording.paths) if time <= now), None), PLANNED, 3),
        (recording.poses[: index + 1, :3], DRIVEN, 3),
    ):
        if points is not None and len(points) > 1:
            painter.line(list(map(tuple, camera.project(points).tolist())), fill=colour, width=width)
    scan = next((points for time, points in reversed(recording.scans) if time <= now), None)
    if scan is not None and len(scan):
        for x, y in camera.project(scan).tolist():
            painter.rectangle((x - 1, y - 1, x + 1, y + 1), fill=SCAN)
    _paint_robot(painter, camera, recording, index)
    text = status_text(recording, index) if index < len(recording.times) - 1 else recording.verdict.title
    painter.text((14, 10), text, fill=TEXT, font=ImageFont.load_default(20))


def status_text(recording: Recording, index: int) -> str:
    """Time, speed and tilt of a sample."""
    speed = float(np.hypot(*recording.twists[index, :2]))
    tilt = float(np.degrees(recording.tilt[index]))
    return f"{recording.times[index]:.0f} s   {speed:.1f} m/s   tilt {tilt:.0f}°"


def _paint_robot(painter: ImageDraw.ImageDraw, camera: Camera, recording: Recording, index: int) -> None:
    """The body as a prism, far faces first."""
    shape, row = recording.robot, recording.poses[index]
    size = camera.pixels_per_metre(row[:3]) * float(np.ptp(shape.footprint[:, 0]))
    scale = max(1.0, LEAST_ROBOT * SIZE[0] / max(size, 1e-6))
    body = prism(shape.footprint, 0.0, shape.height)
    turned = Pose((0.0, 0.0, 0.0), tuple(row[3:].tolist())).rotation
    vertices = scale * body.vertices @ turned.T + row[:3]
    placed = Surface(vertices, body.faces)
    _paint_faces(painter, camera, placed, lit_colours(placed, BODY))


def _disc(painter: ImageDraw.ImageDraw, centre: FloatArray, radius: int, colour: Colour) -> None:
    x, y = centre.tolist()
    painter.ellipse((x - radius, y - radius, x + radius, y + radius), fill=colour, outline=(255, 255, 255))
