"""Frames of a run in full colour: the world in the light, plan, track, scan, robot and actors at one time.

Each frame is painted twice as large with a depth for each pixel, then made smaller. Worlds of several storeys are cut
above the robot, as in the replay.
"""

from __future__ import annotations

from collections.abc import Iterator
from types import SimpleNamespace

import numpy as np
from PIL import Image, ImageDraw, ImageFont
from trimesh.remesh import subdivide_to_size

from mbf_abstract.geometry import FloatArray, Pose
from terrain.recording.clearance import yaws_of
from terrain.recording.recording import Recording
from terrain.viewer.pictures.colours import ACTORS, BODY, DRIVEN, LIT_WALL, OBSTACLE, PLANNED, SCAN, Colour
from terrain.viewer.pictures.raster import Camera, Canvas, paint_line, paint_surface
from terrain.viewer.pictures.shading import lit_colours
from terrain.viewer.pictures.shapes import marks, prism, standing_things
from terrain.viewer.pictures.storeys import storeys
from terrain.viewer.scene import look_at_route, scan_hold
from terrain.worlds.surface import NO_SURFACE, Surface, joined

LARGEST_FACE = 1.0  # m
SMOOTHING = 2  # frames are painted so many times as large
SKY_TOP, SKY_BOTTOM = (168, 198, 232), (236, 241, 246)
LEAST_ROBOT = 0.024  # of the picture's width; smaller robots are drawn larger than they are
PLAN_WIDTH, TRACK_WIDTH = 3.4, 2.0  # pixels
PLAN_NEARER, TRACK_NEARER, MARK_NEARER = 0.004, 0.006, 0.03  # shares of the distance by which lines are nearer
DASH = 26  # pixels at the robot; a dash and a gap of a plan
MARK = 7.0  # pixels
TEXT: Colour = (30, 30, 30)
ZOOM = 1.3  # the live view's first camera leaves room for its buttons
HEADROOM = 2.0  # m above the robot that are shown in a world of several storeys
CUT_STEP = 0.5  # m
FOLLOWING = (9.0, 4.5, 0.55)  # lengths of the robot behind it, at least so many metres, height as a share of that
SCAN_POINT = 0.03  # m
UP = np.array([0.0, 0.0, 1.0])
FOLLOW_VIEW = 0.9  # rad, vertical
CLEARANCE = 1.0  # m of the camera above the ground


class MovingPicture:
    """Paints moments of a recording.

    Parameters
    ----------
    size : (width, height)
        Of the frames [pixels].
    """

    def __init__(self, recording: Recording, size: tuple[int, int]) -> None:
        self._recording = recording
        self._fine = SMOOTHING * size[0], SMOOTHING * size[1]
        self._world, self._colours = _world(recording)
        self._has_storeys = bool(storeys(recording.ground))
        self._scan_hold = scan_hold([time for time, _ in recording.scans])
        self._headings = _smooth_headings(recording)
        self._overviews: dict[float, Canvas] = {}  # by the height of the cut
        self.overview = overview_camera(recording, self._fine)

    def frame(self, index: int, follow: bool) -> Image.Image:
        """Paint the sample of this index, from behind the robot or as an overview."""
        camera = self._following(index) if follow else self.overview
        cut = self._cut(index)
        if follow:
            canvas = self._empty(camera, cut)
        else:
            if cut not in self._overviews:
                self._overviews = {cut: self._empty(camera, cut)}
            canvas = self._overviews[cut].copy()
        if len(self._recording.times):
            self._paint_moment(canvas, camera, index, cut)
        for _, pose, colour in marks(self._recording):
            place, width = np.array(pose.position), MARK * SMOOTHING
            stick = np.array([place, place + width / camera.pixels_per_metre(place) * UP])
            paint_line(canvas, camera, stick, colour, width, MARK_NEARER)
        image = Image.fromarray(canvas.pixels).reduce(SMOOTHING)
        self._write_status(image, index)
        return image

    def _empty(self, camera: Camera, cut: float) -> Canvas:
        """The world below the cut; faces that reach above it end there."""
        canvas = _sky(self._fine)
        vertices, faces = self._world
        shown = vertices[faces, 2].min(axis=1, initial=np.inf) < cut
        below = np.column_stack([vertices[:, :2], np.minimum(vertices[:, 2], cut)])
        paint_surface(canvas, camera, Surface(below, faces[shown]), self._colours[shown])
        return canvas

    def _cut(self, index: int) -> float:
        if not self._has_storeys or not len(self._recording.poses):
            return np.inf
        return float(np.floor(self._recording.poses[index, 2] / CUT_STEP) * CUT_STEP + HEADROOM)

    def _paint_moment(self, canvas: Canvas, camera: Camera, index: int, cut: float) -> None:
        recording = self._recording
        now, here = float(recording.times[index]), recording.poses[index, :3]
        plan = next((path for time, path in reversed(recording.paths) if time <= now), None)
        if plan is not None:
            for dash in _dashes(_below(plan, cut), DASH * SMOOTHING / camera.pixels_per_metre(here)):
                paint_line(canvas, camera, dash, PLANNED, PLAN_WIDTH * SMOOTHING, PLAN_NEARER)
        track = _below(recording.poses[: index + 1, :3], cut)
        paint_line(canvas, camera, track, DRIVEN, TRACK_WIDTH * SMOOTHING, TRACK_NEARER)
        seen, scan = next((scan for scan in reversed(recording.scans) if scan[0] <= now), (now, ()))
        if now - seen <= self._scan_hold:
            for point in scan:
                ends = np.array([point - SCAN_POINT * UP, point + SCAN_POINT * UP])
                paint_line(canvas, camera, ends, SCAN, 1.5 * SMOOTHING, PLAN_NEARER)
        for actor in recording.actors:
            if index < len(actor.poses):
                colour = ACTORS.get(actor.thing, OBSTACLE)
                _paint_body(canvas, camera, Surface(actor.vertices, actor.faces), actor.poses[index], colour, 1.0)
        shape = recording.robot
        size = camera.pixels_per_metre(here) * float(np.ptp(shape.footprint[:, 0]))
        scale = max(1.0, LEAST_ROBOT * self._fine[0] / max(size, 1e-6))
        _paint_body(canvas, camera, prism(shape.footprint, 0.0, shape.height), recording.poses[index], BODY, scale)

    def _following(self, index: int) -> Camera:
        """A camera behind and above the robot, above the ground."""
        recording = self._recording
        here = recording.poses[index, :3]
        lengths, least, rise = FOLLOWING
        distance = max(lengths * float(np.ptp(recording.robot.footprint[:, 0])), least)
        heading = self._headings[index]
        position = here + distance * np.array([-np.cos(heading), -np.sin(heading), rise])
        ground = self._world.vertices
        near = np.abs(ground[:, :2] - position[:2]).max(axis=1) < CLEARANCE
        under = ground[near & (ground[:, 2] < self._cut(index)), 2]
        position[2] = max(position[2], float(under.max(initial=-np.inf)) + CLEARANCE)
        return Camera(position, here + 0.3 * distance * rise * UP, FOLLOW_VIEW, self._fine)

    def _write_status(self, image: Image.Image, index: int) -> None:
        recording = self._recording
        text = status_text(recording, index) if index < len(recording.times) - 1 else recording.verdict.title
        ImageDraw.Draw(image).text((14, 10), text, fill=TEXT, font=ImageFont.load_default(20))


def overview_camera(recording: Recording, size: tuple[int, int]) -> Camera:
    """A camera that sees the whole route."""
    wanted = SimpleNamespace()
    look_at_route(wanted, recording)
    field = 2.0 * np.arctan(np.tan(0.5 * wanted.fov) / ZOOM)
    return Camera(np.array(wanted.position, dtype=np.float64), np.array(wanted.look_at), float(field), size)


def status_text(recording: Recording, index: int) -> str:
    """Time, speed and tilt of a sample."""
    speed = float(np.hypot(*recording.twists[index, :2]))
    tilt = float(np.degrees(recording.tilt[index]))
    return f"{recording.times[index]:.0f} s   {speed:.1f} m/s   tilt {tilt:.0f}°"


def _world(recording: Recording) -> tuple[Surface, FloatArray]:
    """All that does not move, and the colours (F, 3) of its faces in the light; large faces in pieces.

    Near the camera faces are left out as a whole.
    """
    parts: list[tuple[Surface, Colour | None]] = []
    if recording.ground is not None:
        parts.append((recording.ground, None))
    for name, surface, colour in standing_things(recording):
        parts.append((surface, LIT_WALL if name == "walls" else colour))
    surfaces, colours = [NO_SURFACE], [np.zeros((0, 3))]
    for surface, paint in parts:
        if len(surface.faces):
            vertices, faces, of_face = subdivide_to_size(*surface, LARGEST_FACE, max_iter=20, return_index=True)
            surfaces.append(Surface(vertices, faces))
            colours.append(lit_colours(surface, paint)[of_face])
    return joined(surfaces), np.concatenate(colours)


def _sky(size: tuple[int, int]) -> Canvas:
    share = np.linspace(0.0, 1.0, size[1])[:, None, None]
    rows = (1.0 - share) * np.array(SKY_TOP) + share * np.array(SKY_BOTTOM)
    pixels = np.broadcast_to(rows, (size[1], size[0], 3)).astype(np.uint8)
    return Canvas(pixels, np.zeros((size[1], size[0]), np.float32))


def _smooth_headings(recording: Recording) -> FloatArray:
    """Headings (n,) [rad] of the robot, averaged over the last second or so."""
    yaw = np.unwrap(yaws_of(recording.poses[:, 3:]))
    for index in range(1, len(yaw)):
        yaw[index] = 0.9 * yaw[index - 1] + 0.1 * yaw[index]
    return np.asarray(yaw)


def _below(points: FloatArray, cut: float) -> FloatArray:
    """Points with nan above the cut, so that lines end there."""
    return np.where(points[:, 2:] < cut, points, np.nan)


def _dashes(points: FloatArray, period: float) -> Iterator[FloatArray]:
    """Parts of a line (n, 3) [m]: the first 62 % of each period [m]."""
    steps = np.nan_to_num(np.linalg.norm(np.diff(points, axis=0), axis=1))
    along = np.concatenate([[0.0], np.cumsum(steps)])
    for begin in np.arange(0.0, along[-1], period):
        end = min(begin + 0.62 * period, along[-1])
        inside = along[(along > begin) & (along < end)]
        at = np.concatenate([[begin], inside, [end]])
        yield np.column_stack([np.interp(at, along, column) for column in points.T])


def _paint_body(canvas: Canvas, camera: Camera, body: Surface, row: FloatArray, colour: Colour, scale: float) -> None:
    """Paint a body at a pose (7,) x y z qx qy qz qw."""
    turned = Pose((0.0, 0.0, 0.0), tuple(row[3:].tolist())).rotation
    placed = Surface(scale * body.vertices @ turned.T + row[:3], body.faces)
    paint_surface(canvas, camera, placed, lit_colours(placed, colour))
