"""Hill shading: how bright each triangle of a ground is in the light of an afternoon sun from the north-west.

Cartographers' shading (Horn, "Hill shading and the reflectance map", 1981, Lambert's law): brightness is the cosine
between the normal and the direction of the light.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.geometry import FloatArray
from terrain.viewer.pictures.colours import FLOOR, Colour, slope_colours
from terrain.worlds.surface import Surface

Colours = NDArray[np.uint8]

LIGHT = np.array([-1.0, 1.0, 1.4]) / np.linalg.norm([-1.0, 1.0, 1.4])
AMBIENT = 0.45
FLAT_GROUND = 0.02  # m of relief; less is a floor


def face_normals(surface: Surface) -> FloatArray:
    """Return unit normals (F, 3) of the faces, turned upwards; (0, 0, 1) for faces without area."""
    a, b, c = (surface.vertices[surface.faces[:, k]] for k in range(3))
    normals = np.cross(b - a, c - a)
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    normals = np.where(lengths > 1e-12, normals / np.maximum(lengths, 1e-12), [[0.0, 0.0, 1.0]])
    return np.asarray(normals * np.where(normals[:, 2:] < 0.0, -1.0, 1.0))


def shaded_triangles(surface: Surface, colours: Colours | None = None) -> tuple[FloatArray, FloatArray]:
    """Triangles of a ground seen from above, lowest first, with their colours.

    Parameters
    ----------
    colours : (V, 3) uint8, optional
        sRGB colour of each vertex, instead of one by slope.

    Returns
    -------
    corners : (F, 3, 2) float64
        x and y [m], to be painted in this order so that bridges cover what is under them.
    colours : (F, 3) float64
        0..1, in the light.
    """
    order = np.argsort(surface.vertices[surface.faces, 2].mean(axis=1), kind="stable")
    return surface.vertices[surface.faces][order][:, :, :2], lit_colours(surface, colours)[order] / 255.0


def plain_triangles(surface: Surface, colour: Colour, edge: float) -> tuple[FloatArray, FloatArray]:
    """Triangles seen from above in one colour, without light; their edges become lines, so that thin walls are seen.

    Parameters
    ----------
    edge : float
        Width of these lines [m].

    Returns
    -------
    corners : (7 F, 3, 2) float64
        x and y [m].
    colours : (7 F, 3) float64
        0..1.
    """
    corners = surface.vertices[surface.faces][:, :, :2]
    begin, end = corners.reshape(-1, 2), np.roll(corners, -1, axis=1).reshape(-1, 2)
    along = (end - begin) / np.maximum(np.linalg.norm(end - begin, axis=1), 1e-12)[:, None]
    aside = 0.5 * edge * np.column_stack([-along[:, 1], along[:, 0]])
    a, b, c, d = begin - aside, end - aside, end + aside, begin + aside
    corners = np.concatenate([corners, np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    return corners, np.tile(np.array(colour) / 255.0, (len(corners), 1))


def lit_colours(surface: Surface, colours: Colours | Colour | None = None) -> FloatArray:
    """Colours (F, 3) 0..255 of the faces in the light; ``colours`` as for ``face_colours``."""
    normals = face_normals(surface)
    brightness = AMBIENT + (1.0 - AMBIENT) * np.clip(normals @ LIGHT, 0.0, 1.0) / LIGHT[2]
    return np.asarray(np.clip(face_colours(surface, normals, colours) * brightness[:, None], 0.0, 255.0))


def face_colours(surface: Surface, normals: FloatArray, colours: Colours | Colour | None = None) -> FloatArray:
    """Colours (F, 3) 0..255 without light: one for all or those of the vertices, if given; a floor's grey; by slope."""
    if isinstance(colours, tuple):
        return np.tile(np.array(colours, dtype=np.float64), (len(surface.faces), 1))
    if colours is not None:
        return np.asarray(colours[surface.faces].mean(axis=1), dtype=np.float64)
    if np.ptp(surface.vertices[:, 2]) < FLAT_GROUND:
        return face_colours(surface, normals, FLOOR)
    return slope_colours(np.degrees(np.arccos(np.clip(normals[:, 2], -1.0, 1.0))))


def vertex_colours(surface: Surface) -> NDArray[np.uint8]:
    """Colours (V, 3) uint8 sRGB of the vertices, the mean of their faces."""
    of_faces = face_colours(surface, face_normals(surface))
    sums, counts = np.zeros((len(surface.vertices), 3)), np.zeros(len(surface.vertices))
    for corner in range(3):
        np.add.at(sums, surface.faces[:, corner], of_faces)
        np.add.at(counts, surface.faces[:, corner], 1.0)
    return np.asarray(np.round(sums / np.maximum(counts, 1.0)[:, None]), dtype=np.uint8)
