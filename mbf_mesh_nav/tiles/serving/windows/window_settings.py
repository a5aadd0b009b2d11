"""The layers of a window around the robot: those of the configuration, which sense, over those of the tiles."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from mbf_abstract.maps.layers.layer_list import LayerListError, PlannedLayer, layer_loader
from mbf_mesh_nav.layers.combinations.max_combination import MaxCombinationLayer
from mbf_mesh_nav.map.layer import MeshLayer
from mbf_mesh_nav.map.map_builder import LayerLoader, plan_mesh_layers
from mbf_mesh_nav.map.map_parameters import MeshLayerEntry, MeshMapParameters
from mbf_mesh_nav.tiles.building.tile_settings import reach_of
from mbf_mesh_nav.tiles.serving.surroundings import StoredLayer
from mbf_mesh_nav.tiles.tiled_map import TiledMap

SHOWN = "shown"
"""Name of the layer that planners and controllers see: the worse of the profile's layer and the default layer."""
AS_BUILT = "{} as built"
"""Name of the profile's layer if a layer of the configuration has its name."""
STORED = "stored"
OWN_TYPES: dict[str, type[MeshLayer]] = {STORED: StoredLayer, "max_combination": MaxCombinationLayer}
MOVES_AT = 0.25
"""Share of its side that the robot may be away from the middle of a window, along x or y."""


@dataclass(frozen=True, eq=False)
class WindowSettings:
    """How windows are made.

    Attributes
    ----------
    side : float
        [m]
    planned : tuple of PlannedLayer
        All layers of a window, inputs first; empty = the stored ones only.
    live : frozenset of str
        Names of those that the configuration lists.
    reach : float
        How far [m] they look around a vertex.
    driven : float
        How far [m] the robot drives at most between two updates.
    """

    side: float
    planned: tuple[PlannedLayer[MeshLayer], ...] = ()
    live: frozenset[str] = frozenset()
    reach: float = 0.0
    driven: float = 0.0

    def require_room(self, looks: float) -> None:
        """ValueError unless a window always holds all on which ``looks`` [m] around the robot depend."""
        needed = (looks + self.reach + self.driven) / MOVES_AT
        if needed >= self.side:
            raise ValueError(
                f"tiled_map.window: expected more than {needed:.4g} m, got {self.side:g} m; with its parameters it "
                f"looks {looks:.4g} m around the robot, which drives {self.driven:.3g} m between updates, and the "
                f"layers look {self.reach:.4g} m around a vertex"
            )


def window_settings(
    tiled: TiledMap,
    side: float,
    entries: Sequence[MeshLayerEntry] = (),
    blocks: Mapping[str, Any] | None = None,
    default_layer: str = "",
    inscribed_radius: float = 0.0,
    load_layer: LayerLoader | None = None,
    driven: float = 0.0,
) -> WindowSettings:
    """Check the layers of a configuration against those of the tiles.

    Parameters
    ----------
    side : float
        [m]
    entries, blocks
        The layers that sense, and those that read them, and their parameters by name. One with the name of a stored
        layer takes its place.
    default_layer : str
        The layer that counts beside that of the map's profile; empty = the last one of ``entries``.
    driven : float
        How far [m] the robot drives at most between two updates.

    Raises
    ------
    LayerListError
        With all findings.
    """
    if not entries:
        return WindowSettings(side, driven=driven)
    live = frozenset(entry.name for entry in entries)
    profile_layer = tiled.profile_layer
    built = AS_BUILT.format(profile_layer) if profile_layer in live else profile_layer
    kept = [name for name in tiled.index.layers if name not in live]
    stored = [MeshLayerEntry(name=name, type=STORED) for name in dict.fromkeys([*kept, built])]
    load = load_layer or layer_loader("mesh", MeshLayer)
    default = default_layer or _last_with_costs(entries, load) or built
    shown = MeshLayerEntry(name=SHOWN, type="max_combination", inputs=tuple(dict.fromkeys((built, default))))
    parameters = MeshMapParameters(
        layers=(*stored, *entries, shown), default_layer=default, inscribed_radius=inscribed_radius
    )
    plan = plan_mesh_layers(parameters, blocks or {}, lambda name: OWN_TYPES.get(name) or load(name))
    findings = [*_senseless(plan, live), *_forgetful(plan), *_too_wide(plan, side)]
    if default_layer and default not in live:
        findings.append(f"default_layer {default!r}: expected one of the listed layers, {', '.join(sorted(live))}")
    if findings:
        raise LayerListError("; ".join(findings))
    return WindowSettings(side, tuple(plan), live, reach_of(plan), driven)


def _last_with_costs(entries: Sequence[MeshLayerEntry], load: LayerLoader) -> str:
    """Name of the last layer that has costs; empty if none has, or its type does not load."""
    for entry in reversed(entries):
        try:
            if load(entry.type).has_costs:
                return entry.name
        except Exception:  # the plan of the layers reports it
            return entry.name
    return ""


def _senseless(plan: Sequence[PlannedLayer[MeshLayer]], live: frozenset[str]) -> list[str]:
    """Findings about layers that neither sense nor read one that does."""
    sensing: set[str] = set()
    for planned in plan:  # inputs first
        senses = planned.layer_class.insert_scan is not MeshLayer.insert_scan
        if senses or not planned.layer_class.has_costs or not sensing.isdisjoint(planned.entry.reads):
            sensing.add(planned.entry.name)
    return [
        f"layer {name!r} takes no scans and reads no layer that does, so its values are those of the tiles: build them "
        "with it and leave it out here"
        for name in (planned.entry.name for planned in plan)
        if name in live and name not in sensing
    ]


def _forgetful(plan: Sequence[PlannedLayer[MeshLayer]]) -> list[str]:
    """Findings about layers that sense and would know nothing on the next window."""
    return [
        f"layer {planned.entry.name!r} takes scans and does not override 'take_over', so its obstacles would be lost "
        "whenever the window moves"
        for planned in plan
        if planned.layer_class.insert_scan is not MeshLayer.insert_scan
        and planned.layer_class.take_over is MeshLayer.take_over
    ]


def _too_wide(plan: Sequence[PlannedLayer[MeshLayer]], side: float) -> list[str]:
    """A finding if layers look farther than the robot comes to the edge of a window."""
    reach, room = reach_of(list(plan)), MOVES_AT * side
    if reach < room:
        return []
    return [
        f"the layers look {reach:g} m around a vertex, a window of {side:g} m leaves {room:g} m around the robot: "
        f"expected a window of more than {reach / MOVES_AT:g} m"
    ]
