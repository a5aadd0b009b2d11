"""Building a ``LayeredCostmap`` from configuration.

A costmap's block has the keys of ``CostmapParameters``; each layer's own parameters stand in a block of the layer's
name, as in the plugin lists of MBF::

    global_costmap:
      resolution: 0.05
      robot_radius: 0.25
      layers:
        - {name: walls, type: static}
        - {name: inflation, type: inflation}
      walls: {map_file: office.yaml}
      inflation: {inflation_radius: 0.6}
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import cast

from pydantic import field_validator, model_validator

from mbf_abstract.geometry import FARTHEST_COORDINATE
from mbf_abstract.geometry.transform_buffer import TransformBuffer
from mbf_abstract.maps.layers.layer_list import LayerBlocks, LayerEntry, layer_loader, made_layer, plan_layers
from mbf_abstract.maps.sensing import TRANSFORM_TOLERANCE
from mbf_abstract.parameters import ParameterModel, parameter
from mbf_costmap_nav.files.map_description import MapError
from mbf_costmap_nav.grid.costmap import MAX_CELLS, Costmap, GridGeometry
from mbf_costmap_nav.grid.footprint import Footprint
from mbf_costmap_nav.map.layer import CostmapLayer, LayerContext
from mbf_costmap_nav.map.layered_costmap import LayeredCostmap
from mbf_costmap_nav.map.static_maps import StaticMaps


class CostmapParameters(ParameterModel):
    """Parameters of one costmap, with costmap_2d's names and defaults."""

    frame_id: str = parameter(
        "map", "Frame of the grid; plans are made in global_frame, a local map may be in odom.", dynamic=False
    )
    rolling_window: bool = parameter(False, "Keep the grid centred on the robot.", dynamic=False)
    width: float = parameter(10.0, "Extent along x; a static map replaces it.", unit="m", gt=0.0, dynamic=False)
    height: float = parameter(10.0, "Extent along y; a static map replaces it.", unit="m", gt=0.0, dynamic=False)
    resolution: float = parameter(0.1, "Side of a cell.", unit="m", ge=1e-4, le=1e3, dynamic=False)
    origin_x: float = parameter(
        0.0,
        "X of the lower-left corner.",
        unit="m",
        ge=-FARTHEST_COORDINATE,
        le=FARTHEST_COORDINATE,
        dynamic=False,
    )
    origin_y: float = parameter(
        0.0,
        "Y of the lower-left corner.",
        unit="m",
        ge=-FARTHEST_COORDINATE,
        le=FARTHEST_COORDINATE,
        dynamic=False,
    )
    robot_radius: float = parameter(0.46, "Radius of a round robot; a footprint replaces it.", unit="m", ge=0.0, le=1e6)
    footprint: str | list[tuple[float, float]] | None = parameter(
        None, "Corners of the robot, [[x, y], ...] or the same as text.", unit="m"
    )
    footprint_padding: float = parameter(0.01, "Padding of the footprint (costmap_2d's sign rule).", unit="m", ge=0.0)
    track_unknown_space: bool = parameter(False, "Whether unknown is a value of its own.", dynamic=False)
    update_frequency: float = parameter(
        5.0, "How often the server updates the map.", unit="Hz", gt=0.0, le=1000.0, dynamic=False
    )
    max_age: float = parameter(
        2.0, "Time after the last update at which the map stops being current; 0 = never.", unit="s", ge=0.0
    )
    transform_tolerance: float = parameter(
        TRANSFORM_TOLERANCE,
        "A scan this much newer than the newest transform is placed by that one; a newer one is not used.",
        unit="s",
        ge=0.0,
        le=10.0,
        dynamic=False,
    )
    confine_images: bool = parameter(
        False, "Refuse maps and masks whose image lies out of their YAML file's folder.", dynamic=False
    )
    max_cells: int = parameter(
        MAX_CELLS,
        "Larger grids, maps and masks are refused before memory is taken.",
        ge=1,
        le=178_000_000,  # Pillow opens no larger images
        dynamic=False,
    )
    layers: tuple[LayerEntry, ...] = parameter((), "Layers in order of writing.", dynamic=False)

    @field_validator("footprint")
    @classmethod
    def _footprint_is_a_polygon(
        cls, value: str | list[tuple[float, float]] | None
    ) -> str | list[tuple[float, float]] | None:
        if value is not None:
            Footprint.parse(value)
        return value

    @model_validator(mode="after")
    def _size_has_a_limit(self) -> CostmapParameters:
        columns, rows = self.width / self.resolution, self.height / self.resolution
        if columns * rows > self.max_cells:
            raise ValueError(
                f"at most {self.max_cells} cells (max_cells), not the {columns:g} x {rows:g} of width, height and "
                "resolution"
            )
        return self

    def robot_footprint(self) -> Footprint:
        """Return the robot's outline without padding."""
        return Footprint.circle(self.robot_radius) if self.footprint is None else Footprint.parse(self.footprint)

    def geometry(self) -> GridGeometry:
        """Return the grid these numbers describe, with at least one cell."""
        columns = max(1, round(self.width / self.resolution))
        rows = max(1, round(self.height / self.resolution))
        return GridGeometry(columns, rows, self.resolution, self.origin_x, self.origin_y)


def build_layered_costmap(
    parameters: CostmapParameters,
    layer_blocks: LayerBlocks | None = None,
    *,
    load_layer: Callable[[str], type[CostmapLayer]] | None = None,
    base_folder: Path | str = ".",
    static_map: Costmap | None = None,
    transforms: TransformBuffer | None = None,
    static_maps: StaticMaps | None = None,
) -> LayeredCostmap:
    """Make a costmap with its layers.

    Parameters
    ----------
    parameters : CostmapParameters
        The costmap's block without the blocks of its layers.
    layer_blocks : mapping
        Layer name -> its block, raw or validated already; a layer without one gets its defaults.
    load_layer : callable, optional
        Type -> class; without it the installed types.
    base_folder : path
        Where relative file names in layer blocks start.
    static_map : Costmap, optional
        Map of static layers that name no file.
    transforms : TransformBuffer, optional
        For layers whose data is in another frame than the costmap.
    static_maps : StaticMaps, optional
        Is asked for the floor plans of the layers, and shows them those of other costmaps.

    Raises
    ------
    LayerListError
        Unknown layer types, bad parameters, a block no layer has, layers of one name: all findings.
    MapError
        A layer's map file cannot be used.
    """
    plan = plan_layers(parameters.layers, layer_blocks or {}, load_layer or layer_loader("costmap", CostmapLayer))
    static_maps = StaticMaps(transforms) if static_maps is None else static_maps
    layers: list[CostmapLayer] = []
    for planned in plan:
        context = LayerContext(
            name=planned.entry.name,
            parameters=planned.parameters,
            frame_id=parameters.frame_id,
            rolling_window=parameters.rolling_window,
            track_unknown_space=parameters.track_unknown_space,
            base_folder=Path(base_folder),
            confine_images=parameters.confine_images,
            static_map=static_map,
            transforms=transforms,
            max_cells=parameters.max_cells,
            static_maps=static_maps,
        )
        make = cast(Callable[[LayerContext], CostmapLayer], planned.layer_class)
        layers.append(made_layer(context.name, partial(make, context), passing=(MapError,)))
    for layer in layers:
        static_maps.add(partial(getattr, layer, "floor_plan"))
    return LayeredCostmap(
        parameters.geometry(),
        layers,
        parameters.robot_footprint(),
        footprint_padding=parameters.footprint_padding,
        frame_id=parameters.frame_id,
        rolling_window=parameters.rolling_window,
        track_unknown_space=parameters.track_unknown_space,
        max_age=parameters.max_age,
    )
