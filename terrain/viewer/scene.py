"""The three-dimensional scene of a run in viser: ground, walls, goals, and a robot that can be placed.

Shared by the replay and the live view. Lines have a width in pixels, so they can be seen from any distance; walls are
cut low, so that rooms can be seen from above.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from mbf_abstract.geometry import FloatArray, Pose
from terrain.recording.actor_track import ActorTrack
from terrain.recording.recorded_robot import RobotShape
from terrain.recording.recording import Recording
from terrain.viewer.pictures.colours import (
    ACTORS,
    BODY,
    DRIVEN,
    OBSTACLE,
    PLANNED,
    SCAN,
    WHEEL,
    Colour,
    linear_for_viewer,
)
from terrain.viewer.pictures.shading import LIGHT, Colours, vertex_colours
from terrain.viewer.pictures.shapes import marks, prism, robot_body, standing_things
from terrain.worlds.surface import Surface

Scene = Any  # viser.SceneApi; viser is imported only where a server is started

PIN_HEIGHT = 0.03  # of the length of the route
LINE_LIFT = 0.12  # m that lines float above the ground, so that bumps do not hide them
LINE_WIDTH = 4.0  # pixels
SCAN_POINT = 0.06  # m
CAMERA_FIELD_OF_VIEW = 0.8  # rad, vertical
CAMERA_HEIGHT = 0.8  # of the length of the route
CAMERA_SETBACK = 0.85
LEAST_HOLD = 2.0  # s that a scan is shown


def add_surroundings(scene: Scene, recording: Recording) -> None:
    """Add what does not move apart from the ground: light, walls and obstacles, and pins at start and goals."""
    scene.set_up_direction("+z")
    _add_light(scene)
    for name, surface, colour in standing_things(recording):
        _add_solid(scene, f"/{name}", surface, colour)
    height = pin_height(recording)
    for name, pose, colour in marks(recording):
        add_pin(scene, f"/{name}", pose, colour, name, height)


def _add_light(scene: Scene) -> None:
    """A sun in the north-west, as on maps, and enough sky that no wall is black."""
    scene.configure_environment_map(hdri=None)
    scene.configure_default_lights(False)
    scene.add_light_hemisphere("/light/sky", sky_color=(255, 255, 255), ground_color=(190, 180, 165), intensity=2.6)
    scene.add_light_directional("/light/sun", color=(255, 250, 240), intensity=3.2, position=tuple(100.0 * LIGHT))


def add_ground(scene: Scene, ground: Surface, colours: Colours | None = None, name: str = "/ground") -> Any:
    """Add a surface in the colours (V, 3) of its vertices, or by its slope, smooth in the light."""
    import trimesh

    linear = linear_for_viewer(vertex_colours(ground) if colours is None else colours)
    mesh = trimesh.Trimesh(ground.vertices, ground.faces, vertex_colors=linear, process=False)
    mesh.vertex_normals  # noqa: B018 - computing them makes the export carry them, else the viewer shades it flat
    return scene.add_mesh_trimesh(name, mesh, cast_shadow=False, receive_shadow=False)


def _add_solid(scene: Scene, name: str, surface: Surface, colour: Colour) -> None:
    scene.add_mesh_simple(
        name, surface.vertices, surface.faces, color=colour, flat_shading=True, side="double",
        cast_shadow=False, receive_shadow=False,
    )  # fmt: skip


def add_pin(scene: Scene, name: str, pose: Pose, colour: Colour, label: str, height: float) -> Any:
    """Add a stick with a ball, and its name, on a frame of its own."""
    frame = scene.add_frame(name, show_axes=False)
    x, y, z = pose.position
    ball = (x, y, z + height)
    segment = np.array([[pose.position, ball]])
    scene.add_line_segments(f"{name}/stick", segment, colour, thickness=LINE_WIDTH, thickness_units="screen")
    scene.add_icosphere(f"{name}/ball", radius=0.14 * height, color=colour, position=ball, cast_shadow=False)
    scene.add_label(f"{name}/label", label, position=(x, y, z + 1.25 * height), anchor="bottom-center")
    return frame


def add_path(scene: Scene, name: str, points: FloatArray, colour: Colour = PLANNED) -> Any:
    """Add a line through points (m, 3) [m] a little above the ground; None for less than two points."""
    if len(points) < 2:
        return None
    lifted = points + np.array([0.0, 0.0, LINE_LIFT])
    segments = np.stack([lifted[:-1], lifted[1:]], axis=1).astype(np.float32)
    return scene.add_line_segments(name, segments, colour, thickness=LINE_WIDTH, thickness_units="screen")


def add_track_piece(scene: Scene, name: str, points: FloatArray) -> Any:
    """Add a piece of the driven track, a little above plans, so that it covers them."""
    return add_path(scene, name, points + np.array([0.0, 0.0, LINE_LIFT]), DRIVEN)


def add_scan(scene: Scene, name: str, points: FloatArray) -> Any:
    """Add the points a range sensor hit, replacing a node of the same name."""
    return scene.add_point_cloud(
        name, points, SCAN, point_size=SCAN_POINT, point_shape="circle", precision="float32"
    )  # fmt: skip


def pin_height(recording: Recording) -> float:
    """Height [m] of markers that can be seen from where the whole route is in the picture."""
    _, lower, upper = route_of(recording)
    return max(1.2, PIN_HEIGHT * float(np.linalg.norm(upper - lower)))


def route_of(recording: Recording) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Start and goals (k, 3), and the lower and upper corner (3,) of the box around them and the track."""
    ends = np.array([pose.position for pose in (recording.start, *recording.goals)])
    points = np.concatenate([ends, recording.poses[:, :3]])
    return ends, points.min(axis=0), points.max(axis=0)


def look_at_route(camera: Any, recording: Recording, farther: float = 1.0, upright: bool = False) -> None:
    """Put the camera where start, goals and track are all in the picture.

    It looks slantwise from the side; into an ``upright`` picture, such as a phone's, from behind the start.
    """
    ends, lower, upper = route_of(recording)
    middle, length = (lower + upper) / 2.0, farther * max(float(np.linalg.norm(upper - lower)), 6.0)
    along = (ends[-1, :2] - ends[0, :2]) / max(float(np.linalg.norm(ends[-1, :2] - ends[0, :2])), 1e-9)
    setback = -along if upright else np.array([along[1], -along[0]])
    if not setback.any():
        setback = np.array([0.0, -1.0])
    camera.fov = CAMERA_FIELD_OF_VIEW
    camera.position = (*(middle[:2] + CAMERA_SETBACK * length * setback), middle[2] + CAMERA_HEIGHT * length)
    camera.look_at = tuple(middle)


class RobotModel:
    """Body and wheels of a robot in the scene, and a label on a stick with its status.

    Parameters
    ----------
    label_height : float
        Where the label floats [m].
    """

    def __init__(self, scene: Scene, shape: RobotShape, label_height: float) -> None:
        self._frame = scene.add_frame("/robot", show_axes=False)
        top = shape.height
        _add_solid(scene, "/robot/body", robot_body(shape), BODY)
        forward = np.array([0.6 * shape.footprint[:, 0].max(), 0.0])
        nose = prism(shape.footprint * np.array([0.25, 0.5]) + forward, top, top + 0.03)
        _add_solid(scene, "/robot/nose", nose, WHEEL)
        width = 0.64 * shape.wheel_radius
        self._wheels = [
            _add_wheel(scene, f"/robot/wheel_{k}", wheel, shape, width) for k, wheel in enumerate(shape.wheels)
        ]
        stick = np.array([[[0.0, 0.0, shape.height], [0.0, 0.0, label_height]]])
        scene.add_line_segments("/robot/stick", stick, BODY, thickness=LINE_WIDTH, thickness_units="screen")
        place = (0.0, 0.0, 1.05 * label_height)
        self._label = scene.add_label("/robot/label", "", position=place, anchor="bottom-center")

    def place(self, pose: FloatArray, wheel_angles: FloatArray, text: str) -> None:
        """Move to a pose (7,) x y z qx qy qz qw, turn the wheels to angles (k,) [rad], write the label."""
        x, y, z, qx, qy, qz, qw = pose.tolist()
        self._frame.position = (x, y, z)
        self._frame.wxyz = (qw, qx, qy, qz)
        for wheel, angle in zip(self._wheels, wheel_angles.tolist(), strict=True):
            wheel.wxyz = (np.cos(angle / 2.0), 0.0, np.sin(angle / 2.0), 0.0)
        if self._label.text != text:
            self._label.text = text


class ActorModels:
    """People, doors and other robots in the scene, placed together.

    Parameters
    ----------
    tracks : sequence of ActorTrack
        What each is and looks like.
    """

    def __init__(self, scene: Scene, tracks: Sequence[ActorTrack]) -> None:
        self._frames = [scene.add_frame(f"/actor_{k}", show_axes=False) for k in range(len(tracks))]
        for number, track in enumerate(tracks):
            colour = ACTORS.get(track.thing, OBSTACLE)
            _add_solid(scene, f"/actor_{number}/{track.thing}", Surface(track.vertices, track.faces), colour)

    def place(self, poses: Iterable[FloatArray]) -> None:
        """Move each to its pose (7,) x y z qx qy qz qw."""
        for frame, pose in zip(self._frames, poses, strict=True):
            x, y, z, qx, qy, qz, qw = pose.tolist()
            frame.position, frame.wxyz = (x, y, z), (qw, qx, qy, qz)


def wheel_angles(shape: RobotShape, times: FloatArray, twists: FloatArray) -> FloatArray:
    """Angles (n, k) [rad] of wheels that roll without slipping, from motion (n, 3) in the base frame."""
    forward = twists[:, :1] - twists[:, 2:] * shape.wheels[:, 1]
    steps = np.diff(times, prepend=times[:1])[:, None]
    return np.asarray(np.cumsum(forward * steps, axis=0) / shape.wheel_radius)


def scan_hold(times: Sequence[float]) -> float:
    """How long a scan is shown [s] where no newer one comes: longer than between two of them, at these times [s]."""
    return max(LEAST_HOLD, 1.5 * float(np.median(np.diff(times)))) if len(times) > 1 else LEAST_HOLD


def _add_wheel(scene: Scene, node: str, centre: FloatArray, shape: RobotShape, width: float) -> Any:
    """A frame that turns about y, with a drum in it that has a light spoke, so that one sees it turn."""
    frame = scene.add_frame(node, show_axes=False, position=tuple(centre))
    half = np.sqrt(0.5)  # a quarter turn about x lays the drum's axis along y
    scene.add_cylinder(
        f"{node}/drum", shape.wheel_radius, width, color=WHEEL, wxyz=(half, half, 0.0, 0.0),
        cast_shadow=False, receive_shadow=False,
    )  # fmt: skip
    spoke = (1.5 * shape.wheel_radius, 1.04 * width, 0.3 * shape.wheel_radius)
    scene.add_box(f"{node}/spoke", dimensions=spoke, color=(170, 170, 175), cast_shadow=False)
    return frame
