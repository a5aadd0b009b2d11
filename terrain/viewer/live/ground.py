"""The ground of the live view in the colours of the map that the robot plans on, layer by layer.

A mesh map brings its own surface; its layers colour the vertices. Cells of a grid lie on a level floor as a picture, or
are draped over the terrain. The local map of a server that has one lies over it.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.geometry import FloatArray
from mbf_abstract.maps.view import GridView, MapView, MeshView
from mbf_abstract.server.navigation_server import AbstractNavigationServer
from terrain.viewer.live.overlay import Overlay
from terrain.viewer.pictures.colours import FLOOR, SLOPE_COLOURS, WALL, cost_colours_up_to
from terrain.viewer.pictures.plan_picture import COSTLY, cost_colours
from terrain.viewer.pictures.shading import FLAT_GROUND, vertex_colours
from terrain.viewer.scene import add_ground
from terrain.worlds.surface import Surface

OWN_LOOK = "the ground itself"
LETHAL = (200, 20, 40)
LIFT = 0.03  # m from one layer of things that lie on the ground to the next
REFRESH = 10  # frames of the page between two looks at the map


class Ground:
    """Ground, local map and forbidden places.

    Parameters
    ----------
    navigation : AbstractNavigationServer
        Whose map is shown.
    ground : Surface
        The world's own, for maps without a surface.
    """

    def __init__(self, server_page: Any, navigation: AbstractNavigationServer, ground: Surface) -> None:
        self._scene = server_page.scene
        self._navigation = navigation
        self._world = ground
        self._is_level = bool(np.ptp(ground.vertices[:, 2]) < FLAT_GROUND)
        self._is_grid = isinstance(navigation.map_view(), GridView)
        shown_on_ground = [name for name in navigation.map_views if name != navigation.local_view]
        gui = server_page.gui
        self._choice = gui.add_dropdown("colours", (*shown_on_ground, OWN_LOOK), hint="What the ground is coloured by")
        self._legend = gui.add_html("")
        self._drawn: tuple[str, int] | None = None  # which colours, and what the map was like
        self._base: Any = None
        self._frame = 0
        self._local = Overlay(gui, "local map") if navigation.local_view else None
        self._lethal = None if self._is_grid else Overlay(gui, "forbidden places")

    def show(self) -> None:
        """Draw what has changed; looks at the map every ``REFRESH`` frames only."""
        chosen = self._choice.value
        if self._frame % REFRESH == 0 or self._drawn is None or chosen != self._drawn[0]:
            self._show_base(chosen)
            self._show_lethal()
            self._show_local()
        self._frame += 1

    def _show_base(self, chosen: str) -> None:
        view = None if chosen == OWN_LOOK else self._navigation.map_view(chosen)
        state = (chosen, 0 if view is None else hash(view.costs.tobytes()))
        if state == self._drawn:
            return
        self._drawn = state
        before, self._base = self._base, self._draw_base(view)
        if before is not None and before.name != self._base.name:
            before.remove()

    def _draw_base(self, view: MapView | None) -> Any:
        if isinstance(view, MeshView):
            return self._draw_mesh(view)
        if isinstance(view, GridView):
            self._legend.content = legend_html([FLOOR, COSTLY], "free", "costly")
            return self._draw_grid(view, "/map")
        self._legend.content = legend_html(SLOPE_COLOURS, "level", "45°", forbidden=False)
        return add_ground(self._scene, self._world)

    def _draw_mesh(self, view: MeshView) -> Any:
        finite = view.costs[np.isfinite(view.costs)]
        top = float(finite.max(initial=0.0)) or 1.0
        self._legend.content = legend_html(SLOPE_COLOURS, "0", f"{top:.3g}")
        return add_ground(self._scene, Surface(view.vertices, view.faces), cost_colours_up_to(top, view.costs))

    def _draw_grid(self, view: GridView, name: str, lift: float = 0.0) -> Any:
        if not self._is_level:
            return self._drape(view, name, lift)
        x_min, x_max, y_min, y_max = view.extent
        pixels = cost_colours(view.costs)[::-1].astype(np.uint8)
        centre = (0.5 * (x_min + x_max), 0.5 * (y_min + y_max), float(self._world.vertices[0, 2]) + lift)
        frame = self._scene.get_handle_by_name(name)
        if frame is None:
            frame = self._scene.add_frame(name, show_axes=False, wxyz=(0.0, 1.0, 0.0, 0.0))
        frame.position = centre
        self._scene.add_image(
            f"{name}/image", pixels, x_max - x_min, y_max - y_min, format="png",
            cast_shadow=False, receive_shadow=False,
        )  # fmt: skip
        return frame

    def _drape(self, view: GridView, name: str, lift: float) -> Any:
        vertices, faces = self._world.vertices, self._world.faces
        costs, inside = costs_at(view, vertices)
        colours = np.where(inside[:, None], cost_colours(costs), vertex_colours(self._world)).astype(np.uint8)
        if lift > 0.0:
            used, faces = _used(faces[inside[faces].all(axis=1)])
            vertices, colours = vertices[used] + np.array([0.0, 0.0, lift]), colours[used]
        return add_ground(self._scene, Surface(vertices, faces), colours, name) if len(faces) else None

    def _show_local(self) -> None:
        if self._local is None:
            return
        view = self._navigation.map_view(self._navigation.local_view)
        if isinstance(view, GridView):
            key = (view.extent, hash(view.costs.tobytes()))
            self._local.update(key, lambda: self._draw_grid(view, "/local_map", LIFT))

    def _show_lethal(self) -> None:
        view = self._navigation.map_view()
        if self._lethal is None or not isinstance(view, MeshView):
            return
        faces = view.faces[np.isinf(view.costs)[view.faces].all(axis=1)]
        key = hash(faces.tobytes()) if len(faces) else None
        self._lethal.update(key, lambda: self._draw_lethal(view.vertices, faces))

    def _draw_lethal(self, vertices: FloatArray, faces: NDArray[np.int32]) -> Any:
        used, faces = _used(faces)
        return self._scene.add_mesh_simple(
            "/lethal", vertices[used] + np.array([0.0, 0.0, LIFT]), faces, color=LETHAL, opacity=0.5,
            cast_shadow=False, receive_shadow=False,
        )  # fmt: skip


def _used(faces: NDArray[np.int32]) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """Vertices (n,) that faces have, and the faces counted in those."""
    used, corners = np.unique(faces, return_inverse=True)
    return used, corners.reshape(-1, 3).astype(np.int32)


def costs_at(view: GridView, points: FloatArray) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    """Costs (n,) of the cells that points (n, 2 or more) [m] lie in, and whether each lies in the grid (else nan)."""
    x_min, x_max, y_min, y_max = view.extent
    rows, columns = view.costs.shape
    column = np.floor((points[:, 0] - x_min) / (x_max - x_min) * columns).astype(int)
    row = np.floor((points[:, 1] - y_min) / (y_max - y_min) * rows).astype(int)
    inside = (column >= 0) & (column < columns) & (row >= 0) & (row < rows)
    costs = np.full(len(points), np.nan, dtype=np.float32)
    costs[inside] = view.costs[row[inside], column[inside]]
    return costs, inside


def legend_html(colours: Any, low: str, high: str, forbidden: bool = True) -> str:
    """A bar of colours with labels at its ends."""
    stops = ",".join(f"rgb({int(red)},{int(green)},{int(blue)})" for red, green, blue in colours)
    bar = f'<span style="flex:1;height:0.8em;border-radius:2px;background:linear-gradient(to right,{stops})"></span>'
    box = '<span style="width:0.8em;height:0.8em;border-radius:2px;background:rgb({},{},{})"></span>'
    end = f"{box.format(*WALL)}<span>forbidden</span>" if forbidden else ""
    style = "display:flex;gap:0.5em;align-items:center;font-size:0.75em;padding:0 1em"
    return f'<div style="{style}"><span>{low}</span>{bar}<span>{high}</span>{end}</div>'
