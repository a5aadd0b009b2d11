"""The values under a visitor's pointer: the place, and the value of each layer of the map there.

Costs of a mesh are those of its vertices, so the nearest vertex answers. Costs of a grid are those of its cells; below
them stands what the cell was after each layer, in the order in which they write.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TypeAlias

import numpy as np
from scipy.spatial import cKDTree

from mbf_abstract.geometry import FloatArray
from mbf_abstract.maps.view import GridView, MapView, MeshView
from mbf_abstract.server.navigation_server import AbstractNavigationServer
from terrain.viewer.live.ground import costs_at
from terrain.viewer.pictures.colours import cost_colours_up_to
from terrain.viewer.pictures.plan_picture import cost_colours

INDENT = "\u2003"  # an em space, before the layers of a map
REFRESH = 10  # frames of the page between two looks at the map
Row: TypeAlias = tuple[str, str, str]
"""Name, value and colour, for CSS; no colour where there is nothing to colour."""


class Readout:
    """Values of all layers at places of the ground.

    Parameters
    ----------
    navigation : AbstractNavigationServer
        Whose map answers.
    """

    def __init__(self, navigation: AbstractNavigationServer) -> None:
        self._navigation = navigation
        self._views: dict[str, MapView] = {}
        self._frames_left = 0
        self._vertices: FloatArray | None = None
        self._tree: cKDTree | None = None

    def begin_frame(self) -> None:
        """Look at the map again now and then."""
        if self._frames_left == 0:
            self._frames_left = REFRESH
            views = {name: self._navigation.map_view(name) for name in self._navigation.map_views}
            self._views = {name: view for name, view in views.items() if view is not None}
        self._frames_left -= 1

    def rows(self, place: FloatArray) -> list[Row]:
        """Return what there is at a place (3,) [m] of the ground."""
        x, y, z = place.tolist()
        return [("place", f"{x:.2f}, {y:.2f}, {z:.2f} m", ""), *self._values(place)]

    def _values(self, place: FloatArray) -> Iterator[Row]:
        for name, view in self._views.items():
            if isinstance(view, GridView):
                costs, inside = costs_at(view, place[None])
                yield (name, *(_of_cell(costs[0]) if inside[0] else ("outside", "")))
                layers = self._navigation.layer_costs(name, float(place[0]), float(place[1])) if inside[0] else {}
                for layer, cost in layers.items():
                    yield (f"{INDENT}{layer}", *_of_cell(np.float32(cost)))
            else:
                yield (name, *_of_vertex(view, self._nearest(view, place)))

    def _nearest(self, view: MeshView, place: FloatArray) -> int:
        """Index of the nearest vertex; the tree is made once for all layers of a mesh."""
        if self._tree is None or self._vertices is not view.vertices:
            self._vertices, self._tree = view.vertices, cKDTree(view.vertices)
        return int(self._tree.query(place)[1])


def _of_cell(cost: np.float32) -> tuple[str, str]:
    colour = _css(cost_colours(np.array([cost]))[0])
    if np.isnan(cost):
        return "unknown", colour
    return ("forbidden" if cost >= 1.0 else f"{cost:.2f}"), colour


def _of_vertex(view: MeshView, vertex: int) -> tuple[str, str]:
    cost = view.costs[vertex]
    top = float(view.costs[np.isfinite(view.costs)].max(initial=0.0)) or 1.0
    colour = _css(cost_colours_up_to(top, np.array([cost]))[0])
    return ("forbidden" if np.isinf(cost) else f"{cost:.3g}"), colour


def _css(colour: FloatArray) -> str:
    red, green, blue = (int(channel) for channel in colour)
    return f"rgb({red},{green},{blue})"
