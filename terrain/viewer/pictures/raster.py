"""Triangles painted into a picture with a depth for each pixel, so that what is near hides what is far."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.compiling.decorators import kernel
from mbf_abstract.geometry import FloatArray
from terrain.worlds.surface import Surface

NEAR = 0.1  # m; triangles with a corner nearer to the camera are left out


class Canvas(NamedTuple):
    """A picture: ``pixels`` (h, w, 3) uint8, and ``depths`` (h, w) float32, inverse distances [1/m], 0 for none."""

    pixels: NDArray[np.uint8]
    depths: NDArray[np.float32]

    def copy(self) -> Canvas:
        """Return another canvas with the same contents."""
        return Canvas(self.pixels.copy(), self.depths.copy())


class Camera:
    """A pinhole camera.

    Parameters
    ----------
    position, target : (3,) float64
        Where it is and where it looks [m]; not straight down.
    field_of_view : float
        Vertical [rad].
    size : (width, height)
        Of the picture [pixels].
    """

    def __init__(self, position: FloatArray, target: FloatArray, field_of_view: float, size: tuple[int, int]) -> None:
        self.position = position
        forward = (target - position) / np.linalg.norm(target - position)
        right = np.cross(forward, [0.0, 0.0, 1.0])
        right = right / np.linalg.norm(right)
        self._axes = np.stack([right, np.cross(forward, right), forward])  # right, down, forward
        self._size = size
        self._focal = 0.5 * size[1] / np.tan(0.5 * field_of_view)

    def project(self, points: FloatArray) -> FloatArray:
        """Pixel x, pixel y and inverse distance [1/m] (n, 3) of points (n, 3) [m]; nan where nearer than ``NEAR``."""
        right, down, ahead = ((points - self.position) @ self._axes.T).T
        inverse = 1.0 / np.where(ahead > NEAR, ahead, np.nan)
        scale = self._focal * inverse
        return np.column_stack([0.5 * self._size[0] + scale * right, 0.5 * self._size[1] + scale * down, inverse])

    def pixels_per_metre(self, point: FloatArray) -> float:
        """Size of a metre at a point (3,) [m]."""
        return float(self._focal / max(float((point - self.position) @ self._axes[2]), NEAR))


def paint_surface(canvas: Canvas, camera: Camera, surface: Surface, colours: FloatArray) -> None:
    """Paint faces in colours (F, 3) 0..255."""
    corners = camera.project(surface.vertices)[surface.faces]
    seen = np.isfinite(corners).all(axis=(1, 2))
    paint_triangles(corners[seen], colours[seen].astype(np.uint8), canvas.pixels, canvas.depths)


def paint_line(
    canvas: Canvas, camera: Camera, points: FloatArray, colour: tuple[int, int, int], width: float, nearer: float
) -> None:
    """Paint a line through points (n, 3) [m], ``width`` pixels wide, ``nearer`` by a share of its distance."""
    pixels = camera.project(points)
    begin, end = pixels[:-1], pixels[1:]
    along = end[:, :2] - begin[:, :2]
    lengths = np.linalg.norm(along, axis=1)
    seen = np.isfinite(lengths) & (lengths > 0.0)
    begin, end, along = begin[seen], end[seen], along[seen] / lengths[seen, None] * 0.5 * width
    aside = np.column_stack([-along[:, 1], along[:, 0], np.zeros(len(along))])
    ahead = np.column_stack([along, np.zeros(len(along))])  # pieces overlap, so that bends have no gaps
    a, b, c, d = begin - ahead + aside, begin - ahead - aside, end + ahead - aside, end + ahead + aside
    corners = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    corners[:, :, 2] *= 1.0 + nearer
    paint_triangles(corners, np.tile(np.array(colour, np.uint8), (len(corners), 1)), canvas.pixels, canvas.depths)


@kernel
def paint_triangles(
    corners: FloatArray, colours: NDArray[np.uint8], pixels: NDArray[np.uint8], depths: NDArray[np.float32]
) -> None:
    """Paint triangles (n, 3, 3) of pixel x, pixel y and inverse distance where they are nearer than what is there."""
    height, width = depths.shape
    for t in range(len(corners)):
        ax, ay, az = corners[t, 0]
        bx, by, bz = corners[t, 1]
        cx, cy, cz = corners[t, 2]
        area = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
        if area == 0.0:
            continue
        left = max(0.0, np.ceil(min(ax, bx, cx) - 0.5))
        right = min(width - 1.0, np.floor(max(ax, bx, cx) - 0.5))
        top = max(0.0, np.ceil(min(ay, by, cy) - 0.5))
        bottom = min(height - 1.0, np.floor(max(ay, by, cy) - 0.5))
        for y in range(int(top), int(bottom) + 1):
            for x in range(int(left), int(right) + 1):
                px, py = x + 0.5, y + 0.5
                a = ((bx - px) * (cy - py) - (by - py) * (cx - px)) / area
                b = ((cx - px) * (ay - py) - (cy - py) * (ax - px)) / area
                c = 1.0 - a - b
                if a < 0.0 or b < 0.0 or c < 0.0:
                    continue
                depth = a * az + b * bz + c * cz
                if depth > depths[y, x]:
                    depths[y, x] = depth
                    for channel in range(3):
                        pixels[y, x, channel] = colours[t, channel]
