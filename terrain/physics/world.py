"""A PyBullet world without a window: ground, walls and things put in, and fixed steps of 1/240 s.

Use it where contact matters: slopes, bumps, wheels that slip, doors that push. For sweeps in which contact does not
matter use ``terrain.physics.kinematic_robot`` instead, which is some thirty times faster.

There are two kinds of ground. ``add_heightfield`` is Bullet's own heightfield; the planner's mesh from
``Heightfield.surface`` is the same surface to a fraction of a millimetre. ``add_mesh`` is a concave triangle mesh:
overhangs are possible, rays are faster. Bullet's heightfield has two traps that are guarded here: more than 2**21
samples are cut off silently, and slanted rays miss it where raw heights are positive, so heights are shifted to <= 0
(Bullet 3.25, ``btHeightfieldTerrainShape`` skips chunks by the wrong component). Long lidar rays should still be cast
at the triangles (``terrain.sensors.rays``).
"""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mbf_abstract.geometry import FloatArray, Pose
from mbf_abstract.native_output import quiet_native_output
from terrain.physics.bullet import connect
from terrain.physics.protocols import SimulatedWorld
from terrain.worlds.heightfield import Heightfield
from terrain.worlds.occupancy import OccupancyGrid, wall_surface
from terrain.worlds.surface import Surface, box, cylinder, joined, level_rectangle

TIME_STEP = 1.0 / 240.0
MAX_HEIGHTFIELD_SAMPLES = 2**21  # Bullet's upload buffer: 8 MiB of float32, the rest is cut without an error
MAX_RAYS_PER_CALL = 16_000  # Bullet answers at most 16,383 rays and drops the next one silently
RAY_MARGIN = 1.0  # metres above and below the world where vertical rays start and end

# Collision groups. Fixed bodies do not collide with each other: Bullet would test every post against the ground under
# it in each step. A ray is of Bullet's group 1 and hits the groups in its mask.
RAY, STATIC, ROBOT, MOVING = 1, 2, 4, 8
EVERY_GROUP = RAY | STATIC | ROBOT | MOVING
ORIGIN = Pose((0.0, 0.0, 0.0))


class BulletWorld(SimulatedWorld):
    """A world of its own: several can live in one process. Use as a context manager or call ``close``.

    Parameters
    ----------
    time_step : float
        Of one step [s]. Climbing and turning change by under 3 % between 1/60 and 1/1000 s; longer is faster.

    Attributes
    ----------
    bullet : pybullet_utils.bullet_client.BulletClient
        The functions of PyBullet, for this world.
    ground_bodies : set of int
        Bodies that are there to be driven on; touching any other counts as a collision.
    """

    def __init__(self, time_step: float = TIME_STEP) -> None:
        super().__init__(time_step)
        self.bullet = connect(time_step)
        self._simulate_step = self.bullet.stepSimulation  # the client makes its functions anew at each use
        self.ground_bodies: set[int] = set()
        self.has_moving_bodies = False
        self._static: list[Surface] = []
        self._folder = tempfile.TemporaryDirectory(prefix="mbf_world_")
        self._closed = False

    def close(self) -> None:
        """Free the world; idempotent."""
        if not self._closed:
            self._closed = True
            self.bullet.disconnect()
            self._folder.cleanup()

    def restart_clock(self) -> None:
        """Let this instant be time 0; called once the robots have settled."""
        self.step_count = 0

    def _move_on(self) -> None:
        self._simulate_step()
        self.step_count += 1

    def add_heightfield(self, terrain: Heightfield) -> int:
        """Put a terrain in as Bullet's own heightfield.

        Returns
        -------
        body : int

        Raises
        ------
        ValueError
            More than 2**21 samples, which Bullet would cut off silently.
        """
        if terrain.heights.size > MAX_HEIGHTFIELD_SAMPLES:
            text = f"at most {MAX_HEIGHTFIELD_SAMPLES} samples for Bullet (crop it, or set a larger spacing)"
            raise ValueError(f"expected {text}, got {terrain.ny} x {terrain.nx}")
        shift = float(terrain.heights.max())
        raw = terrain.heights - np.float32(shift)
        shape = self.bullet.createCollisionShape(
            self.bullet.GEOM_HEIGHTFIELD,
            meshScale=[terrain.dx, terrain.dy, 1.0],
            heightfieldData=raw.ravel(),
            numHeightfieldRows=terrain.nx,  # Bullet's "rows" is the number of samples along x
            numHeightfieldColumns=terrain.ny,
        )
        middle = 0.5 * (float(raw.min()) + float(raw.max()))  # Bullet centres z on the middle of the range
        centre = (terrain.x0 + terrain.size[0] / 2, terrain.y0 + terrain.size[1] / 2, middle + shift)
        return self._add_ground(shape, terrain.surface(), Pose(centre))

    def add_mesh(self, vertices: ArrayLike, faces: ArrayLike, ground: bool = True) -> int:
        """Put a fixed, maybe concave triangle mesh in and return its body.

        Parameters
        ----------
        vertices : (n, 3) float
            Corners [m].
        faces : (m, 3) int
            Counter-clockwise seen from outside.
        ground : bool
            False for walls: touching them is a collision.
        """
        surface = Surface(np.array(vertices, dtype=np.float64), np.array(faces, dtype=np.int32))
        file = Path(self._folder.name) / f"mesh_{len(self._static)}.obj"
        np.savetxt(file, surface.vertices, fmt="v %.9g %.9g %.9g")
        with file.open("a", encoding="ascii") as out:
            np.savetxt(out, surface.faces + 1, fmt="f %d %d %d")
        with quiet_native_output():
            shape = self.bullet.createCollisionShape(
                self.bullet.GEOM_MESH, fileName=str(file), flags=self.bullet.GEOM_FORCE_CONCAVE_TRIMESH
            )
        return self._add_ground(shape, surface) if ground else self._add_body(shape, ORIGIN, STATIC, surface)

    def add_building(self, grid: OccupancyGrid) -> None:
        """Put the floor of a building in and every occupied cell as a wall; unknown cells become floor."""
        self.add_ground_plane(*grid.bounds)
        if grid.occupied.any():
            self.add_mesh(*wall_surface(grid), ground=False)

    def add_ground_plane(self, x_min: float, x_max: float, y_min: float, y_max: float) -> int:
        """Put a level floor in at z = 0; it is endless for wheels and as large as given [m] for lidar rays."""
        shape = self.bullet.createCollisionShape(self.bullet.GEOM_PLANE, planeNormal=[0, 0, 1])
        return self._add_ground(shape, level_rectangle(x_min, x_max, y_min, y_max))

    def add_box(self, pose: Pose, size: Sequence[float], moving: bool = False) -> int:
        """Put a box of ``size`` (3,) [m] in, centred at ``pose``.

        Parameters
        ----------
        moving : bool
            True for a box that an actor sets to new poses: ``MovingRays`` see it, ``StaticRays`` do not.
        """
        shape = self.bullet.createCollisionShape(self.bullet.GEOM_BOX, halfExtents=[0.5 * length for length in size])
        return self._add_body(shape, pose, MOVING if moving else STATIC, box(size))

    def add_cylinder(self, pose: Pose, radius: float, height: float, moving: bool = False) -> int:
        """Put an upright cylinder in, centred at ``pose``; parameters as for ``add_box``."""
        shape = self.bullet.createCollisionShape(self.bullet.GEOM_CYLINDER, radius=radius, height=height)
        return self._add_body(shape, pose, MOVING if moving else STATIC, cylinder(radius, height))

    def _add_ground(self, shape: int, surface: Surface, at: Pose = ORIGIN) -> int:
        """Add something to drive on; ``surface`` is in the map, ``at`` is where Bullet puts the shape's origin."""
        self._static.append(surface)
        body = self._add_body(shape, at, STATIC)
        self.ground_bodies.add(body)
        return body

    def _add_body(self, shape: int, pose: Pose, group: int, surface: Surface | None = None) -> int:
        """Add a body without mass; the ``surface`` of a fixed one is seen by rays."""
        self.has_moving_bodies |= group == MOVING
        if group == STATIC and surface is not None:
            self._static.append(surface.at(pose))
        body: int = self.bullet.createMultiBody(0, shape, basePosition=pose.position, baseOrientation=pose.orientation)
        self.set_group(body, group)
        # Bullet multiplies the frictions of the two bodies, and its own default is 0.5
        self.bullet.changeDynamics(body, -1, lateralFriction=1.0)
        return body

    def place_body(self, body: int, pose: Pose) -> None:
        """Put a body at ``pose`` at once."""
        self.bullet.resetBasePositionAndOrientation(body, pose.position, pose.orientation)

    def set_group(self, body: int, group: int) -> None:
        """Put all links of a body into a collision group; it collides with every group, fixed with fixed excepted."""
        collides_with = EVERY_GROUP & ~STATIC if group == STATIC else EVERY_GROUP
        for link in range(-1, self.bullet.getNumJoints(body)):
            self.bullet.setCollisionFilterGroupMask(body, link, group, collides_with)

    def static_surface(self) -> Surface:
        """All that is fixed as one mesh."""
        return joined(self._static)

    def cast_rays(
        self, starts: ArrayLike, ends: ArrayLike, groups: int = STATIC | MOVING
    ) -> tuple[NDArray[np.bool_], FloatArray]:
        """Cast rays from ``starts`` to ``ends``, each (n, 3) [m], at the bodies of ``groups``.

        Returns
        -------
        hit : (n,) bool
        points : (n, 3) float64
            Where each ray hits, or its end [m].
        """
        starts, ends = np.asarray(starts, dtype=float), np.asarray(ends, dtype=float)
        results: list[tuple[int, int, float, tuple[float, float, float], tuple[float, float, float]]] = []
        for first in range(0, len(starts), MAX_RAYS_PER_CALL):
            part = slice(first, first + MAX_RAYS_PER_CALL)
            results += self.bullet.rayTestBatch(starts[part], ends[part], numThreads=1, collisionFilterMask=groups)
        fractions = np.array([result[2] for result in results], dtype=np.float64).reshape(-1, 1)
        return np.array([result[0] >= 0 for result in results], dtype=bool), starts + fractions * (ends - starts)

    def vertical_rays(self, xy: ArrayLike) -> FloatArray:
        """Height [m] of the highest fixed thing at each position ``xy`` (n, 2); nan where there is none."""
        xy = np.asarray(xy, dtype=float)
        heights = self.static_surface().vertices[:, 2]
        top, bottom = float(heights.max(initial=0.0)) + RAY_MARGIN, float(heights.min(initial=0.0)) - RAY_MARGIN
        starts, ends = (np.column_stack([xy, np.full(len(xy), z)]) for z in (top, bottom))
        hit, points = self.cast_rays(starts, ends, STATIC)
        return np.where(hit, points[:, 2], np.nan)
