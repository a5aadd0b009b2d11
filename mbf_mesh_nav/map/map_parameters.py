"""Parameters of a mesh map: the block ``mesh_map`` and the lines of its ``layers`` list."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

import numpy as np
from pydantic import field_validator, model_validator

from mbf_abstract.maps.layers.layer_list import (
    LayerEntry,
)
from mbf_abstract.parameters import parameter
from mbf_mesh_nav.files.mesh_io import MAX_FACES, SPLIT_CORNERS
from mbf_mesh_nav.map.robot_outline import OutlineParameters
from mbf_mesh_nav.mesh.repair import REPAIRS

JOIN, KEEP_APART = "duplicate_vertices", "-duplicate_vertices"


class MeshLayerEntry(LayerEntry):
    """One line of the ``layers`` list of a mesh map."""

    inputs: tuple[str, ...] = parameter((), "Names of the layers it reads.")

    @property
    def reads(self) -> tuple[str, ...]:
        """Its inputs."""
        return self.inputs


class MeshMapParameters(OutlineParameters):
    """Parameters of the ``mesh_map`` block, beside the blocks of the layers."""

    mesh_file: str = parameter(
        "", "File of the mesh; empty if the mesh is given as arrays.", dynamic=False, reads_file=True
    )
    mesh_part: str = parameter("", "Part of the file: path through the scene graph, or HDF5 group.", dynamic=False)
    up_axis: Literal["", "x", "y", "z"] = parameter(
        "",
        "Axis of the file that points up; empty = what the file says (COLLADA) or its format (glTF: y, others: z).",
        dynamic=False,
    )
    unit: float = parameter(
        0.0,
        "Length of the file's unit; 0 = what the file says (COLLADA), or 1.",
        unit="m",
        ge=0.0,
        le=1e6,
        dynamic=False,
    )
    max_faces: int = parameter(MAX_FACES, "Larger files are refused before they are read.", ge=1, dynamic=False)
    repair: tuple[str, ...] = parameter(
        (),
        "Defects of the mesh that may be repaired (see Mesh files). Files of formats without shared corners (STL, OBJ, "
        "DAE, glTF) get duplicate_vertices unasked; -duplicate_vertices keeps it off.",
        dynamic=False,
    )
    join_distance: float = parameter(
        0.0,
        "How far apart vertices at the boundaries of parts may be for duplicate_vertices to join them; "
        "0 = a millionth of the extent of the mesh.",
        unit="m",
        ge=0.0,
        dynamic=False,
    )
    densify: float = parameter(0.0, "Split edges longer than this; 0 = off.", unit="m", ge=0.0, dynamic=False)
    layers: tuple[MeshLayerEntry, ...] = parameter((), "The layers, in any order.", dynamic=False)
    default_layer: str = parameter("", "The layer planners and controllers see; empty = the last one.", dynamic=False)
    edge_cost_factor: float = parameter(0.0, "How much a cost of 1 lengthens an edge, in lengths.", ge=0.0, le=100.0)
    inscribed_radius: float = parameter(
        0.0,
        "Radius of the robot's inner circle; the mesh should be finer than half of it. 0 = unknown; motions are looked "
        "at with the largest one of the layers then.",
        unit="m",
        ge=0.0,
    )
    check_footprint: bool = parameter(
        False,
        "Whether the footprint, too, has to fit wherever plans and motions lead: for long robots among walls. Without, "
        "the disc of inscribed_radius has to.",
    )
    max_turning_slope: float = parameter(
        0.35, "Steeper ground is not turned on in a recovery.", unit="rad", gt=0.0, le=1.5, dynamic=False
    )
    update_frequency: float = parameter(
        10.0, "How often the server updates the map.", unit="Hz", gt=0.0, le=1000.0, dynamic=False
    )
    cache_dir: str = parameter(
        "", "Folder for computed layers, relative to the configuration; empty = no cache.", dynamic=False
    )

    @field_validator("repair")
    @classmethod
    def _repairs_are_known(cls, names: tuple[str, ...]) -> tuple[str, ...]:
        known = {*REPAIRS, KEEP_APART}
        if unknown := [name for name in names if name not in known]:
            raise ValueError(f"names of repairs ({', '.join(REPAIRS)}), not {', '.join(unknown)}")
        if {JOIN, KEEP_APART} <= set(names):
            raise ValueError(f"either {JOIN} or {KEEP_APART}")
        return names

    @model_validator(mode="after")
    def _what_is_checked_is_known(self) -> MeshMapParameters:
        if self.check_footprint and not self.footprint:
            raise ValueError("check_footprint needs a footprint, which is empty")
        return self

    def repairs_for(self, file: str) -> tuple[str, ...]:
        """Names of ``REPAIRS`` to apply to a mesh from ``file``, "" for arrays: the listed ones and the format's."""
        listed = tuple(name for name in self.repair if name != KEEP_APART)
        joins = Path(file).suffix.lower() in SPLIT_CORNERS and KEEP_APART not in self.repair
        return (*listed, JOIN) if joins and JOIN not in listed else listed


def default_layers(inscribed_radius: float) -> tuple[MeshMapParameters, dict[str, dict[str, float]]]:
    """Return parameters and layer blocks for a bare mesh and a robot of ``inscribed_radius`` [m].

    Border, steepness, roughness and height steps are joined and inflated to twice the radius.
    """
    guards = ("border", "steepness", "roughness", "height_diff")
    entries = [MeshLayerEntry(name=guard, type=guard) for guard in guards]
    entries.append(MeshLayerEntry(name="lethal", type="max_combination", inputs=guards))
    entries.append(MeshLayerEntry(name="inflation", type="inflation", inputs=("lethal",)))
    blocks = {
        "steepness": {"threshold": 0.6},
        "roughness": {"threshold": 0.8},
        "height_diff": {"threshold": 0.2, "height_limit": 1.0},
        "inflation": {
            "inscribed_radius": inscribed_radius,
            "inflation_radius": 2.0 * inscribed_radius,
            "lethal_value": np.inf,
            "inscribed_value": 1.0,
            "cost_scaling_factor": 2.0,
        },
    }
    parameters = MeshMapParameters(layers=tuple(entries), edge_cost_factor=1.0, inscribed_radius=inscribed_radius)
    return parameters, blocks
