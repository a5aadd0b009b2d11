"""A run as a small moving picture (GIF), seen slantwise from above: for READMEs and issues, where no script may run.

The world is drawn once, by casting a ray through each pixel; plan, track, scan and robot are painted over it, frame by
frame. For turning, zooming and stopping see ``terrain.viewer.replay``.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from mbf_abstract.geometry import Pose
from terrain.recording.recording import Recording
from terrain.recording.whole_files import replacing
from terrain.viewer.pictures.colours import BODY, DRIVEN, GOAL, OBSTACLE, PLANNED, SCAN, START, WALL, Colour
from terrain.viewer.pictures.picture import ViewerMissing
from terrain.viewer.pictures.shading import AMBIENT, LIGHT, face_colours, face_normals
from terrain.viewer.pictures.shapes import cut_walls, prism
from terrain.viewer.replay import status_text
from terrain.viewer.scene import look_at_route
from terrain.worlds.surface import Surface

FloatArray = NDArray[np.float64]

SIZE = (800, 450)  # pixels
FRAMES = 72
FRAME_TIME, LAST_FRAME_TIME = 90, 2500  # ms
RAYS_PER_PIXEL = 2  # in each direction
SKY = (232, 238, 244)
COLOURS = 96
LEAST_ROBOT = 0.024  # of the picture's width; smaller robots are drawn larger than they are
MARK = 6  # pixels
ZOOM = 1.3  # the replay's first view leaves room for its buttons
TEXT: Colour = (30, 30, 30)
PAINTED = (PLANNED, DRIVEN, START, GOAL, SCAN, BODY, TEXT)
SWATCH = 20  # rows of pixels


def write_animation(file: str | Path, recording: Recording) -> None:
    """Write a recording as GIF; raises ViewerMissing without embreex."""
    frames = list(_frames(recording))
    palette = _palette(frames[0])
    small = [frame.quantize(palette=palette, dither=Image.Dither.NONE) for frame in frames]
    times = [FRAME_TIME] * (len(small) - 1) + [LAST_FRAME_TIME]
    with replacing(file) as part:
        small[0].save(part, save_all=True, append_images=small[1:], duration=times, loop=0, optimize=True)


def _palette(frame: Image.Image) -> Image.Image:
    """The colours of a frame and of everything that is painted over it, which small things would not get otherwise."""
    wide, high = frame.size
    sheet = Image.new("RGB", (wide, high + SWATCH * len(PAINTED)))
    sheet.paste(frame, (0, 0))
    for row, colour in enumerate(PAINTED):
        sheet.paste(colour, (0, high + SWATCH * row, wide, high + SWATCH * (row + 1)))
    return sheet.quantize(COLOURS, dither=Image.Dither.NONE)


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

    def rays(self, per_pixel: int) -> FloatArray:
        """Unit vectors (n, 3) through the pixels, row by row, ``per_pixel`` squared of them for each."""
        width, height = (per_pixel * length for length in self._size)
        x, y = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
        across = np.column_stack([(x.ravel() - 0.5 * width), (y.ravel() - 0.5 * height)]) / (per_pixel * self._focal)
        rays = across @ self._axes[:2] + self._axes[2]
        return np.asarray(rays / np.linalg.norm(rays, axis=1, keepdims=True))


def draw_world(recording: Recording, camera: Camera) -> Image.Image:
    """Draw what does not move; raises ViewerMissing without embreex."""
    try:
        from embreex.mesh_construction import TriangleMesh
        from embreex.rtcore_scene import EmbreeScene
    except ImportError as error:
        raise ViewerMissing(f"animations need embreex: pip install 'mbf-flex[sim]' ({error})") from error
    vertices, faces, colours = _world(recording)
    rays = camera.rays(RAYS_PER_PIXEL).astype(np.float32)
    hit = np.full(len(rays), -1)
    if len(faces):
        scene = EmbreeScene()
        TriangleMesh(scene, (vertices - camera.position).astype(np.float32), faces)
        hit = scene.run(np.zeros_like(rays), rays, query="INTERSECT")
    painted = np.vstack([colours, SKY])[hit]  # -1, no hit, is the last row
    rows, columns = SIZE[1] * RAYS_PER_PIXEL, SIZE[0] * RAYS_PER_PIXEL
    pixels = painted.reshape(rows, columns, 3).round().astype(np.uint8)
    return Image.fromarray(pixels).resize(SIZE, Image.Resampling.BOX)


def _world(recording: Recording) -> tuple[FloatArray, NDArray[np.int32], FloatArray]:
    """All surfaces as one: vertices (V, 3), faces (F, 3), and a shaded colour (F, 3) 0..255 for each face."""
    walls = None if recording.walls is None else cut_walls(recording.walls)
    parts = [(recording.ground, None), (walls, WALL), (recording.obstacles, OBSTACLE)]
    vertices, faces, colours, offset = [np.zeros((0, 3))], [np.zeros((0, 3), np.int32)], [np.zeros((0, 3))], 0
    for surface, paint in parts:
        if surface is None:
            continue
        vertices.append(surface.vertices)
        faces.append((surface.faces + offset).astype(np.int32))
        colours.append(_shaded(surface, paint))
        offset += len(surface.vertices)
    return np.concatenate(vertices), np.concatenate(faces), np.concatenate(colours)


def _shaded(surface: Surface, paint: Colour | None) -> FloatArray:
    normals = face_normals(surface)
    base = face_colours(surface, normals) if paint is None else np.tile(np.array(paint, float), (len(normals), 1))
    brightness = AMBIENT + (1.0 - AMBIENT) * np.clip(normals @ LIGHT, 0.0, 1.0) / LIGHT[2]
    return np.asarray(np.clip(base * brightness[:, None], 0.0, 255.0))


def _frames(recording: Recording) -> Iterator[Image.Image]:
    camera = Camera(recording, SIZE)
    world = draw_world(recording, camera)
    for index in np.linspace(0, max(len(recording.times) - 1, 0), FRAMES).astype(int).tolist():
        frame = world.copy()
        painter = ImageDraw.Draw(frame)
        for pose, colour in ((recording.start, START), *((goal, GOAL) for goal in recording.goals)):
            _disc(painter, camera.project(np.array([pose.position]))[0], MARK, colour)
        if len(recording.times):
            _paint_moment(painter, camera, recording, index)
        yield frame


def _paint_moment(painter: ImageDraw.ImageDraw, camera: Camera, recording: Recording, index: int) -> None:
    """Plan and scan of the time, the track until then, the robot, and how it does."""
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


def _paint_robot(painter: ImageDraw.ImageDraw, camera: Camera, recording: Recording, index: int) -> None:
    """The body as a prism, far faces first."""
    shape, row = recording.robot, recording.poses[index]
    size = camera.pixels_per_metre(row[:3]) * float(np.ptp(shape.footprint[:, 0]))
    scale = max(1.0, LEAST_ROBOT * SIZE[0] / max(size, 1e-6))
    body = prism(shape.footprint, 0.0, shape.height)
    turned = Pose((0.0, 0.0, 0.0), tuple(row[3:].tolist())).rotation
    vertices = scale * body.vertices @ turned.T + row[:3]
    colours = _shaded(Surface(vertices, body.faces), BODY)
    corners = vertices[body.faces]
    far_first = np.argsort(-np.linalg.norm(corners.mean(axis=1) - camera.position, axis=1))
    pixels = camera.project(vertices)[body.faces]
    for face in far_first:
        fill = tuple(colours[face].astype(int).tolist())
        painter.polygon(list(map(tuple, pixels[face].tolist())), fill=fill)


def _disc(painter: ImageDraw.ImageDraw, centre: FloatArray, radius: int, colour: Colour) -> None:
    x, y = centre.tolist()
    painter.ellipse((x - radius, y - radius, x + radius, y + radius), fill=colour, outline=(255, 255, 255))
