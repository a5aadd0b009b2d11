"""Height difference: how far the surface around a vertex reaches above and below its tangent plane [m].

When to use: steps, kerbs, walls and holes that are small against the slope of the surface; pair it with ``steepness``,
because a smooth slope costs nothing here. When not: meshes whose edges are as long as the radius (nothing lies within
it) and noisy scans with random normals.
Rule of mesh_navigation: the neighbourhood is a cylinder about the vertex normal. It has no bound along the normal
there, so next to a wall it can run over the whole mesh; ``height_limit`` bounds it. On a map whose heights have an
error the threshold is lower, by the standard error of the difference of two heights.
"""

from __future__ import annotations

import math

import numpy as np

from mbf_abstract.parameters import parameter
from mbf_mesh_nav.kernels.layers.neighbourhood_layers import height_differences
from mbf_mesh_nav.kernels.layers.patches import (
    bound_patches,
    grow_patches,
    height_differences_by_patches,
    patch_borders,
)
from mbf_mesh_nav.map.height_error import HeightErrorParameters, errors_for, narrowed, step_error
from mbf_mesh_nav.map.layer import CostArray, LethalArray, MeshLayer

_DENSE = 16.0
"""Edges in a radius from which patches pay: of about 48 vertices, they are then small against the neighbourhood."""


class HeightDiffParameters(HeightErrorParameters):
    """Parameters of ``height_diff``."""

    threshold: float = parameter(0.185, "Lethal above this height difference.", unit="m", gt=0.0)
    radius: float = parameter(0.3, "Radius of the neighbourhood, across the normal.", unit="m", gt=0.0, le=5.0)
    height_limit: float = parameter(
        np.inf, "Half the height of the neighbourhood, along the normal.", unit="m", gt=0.0, allow_inf=True
    )


class HeightDiffLayer(MeshLayer):
    """Greatest minus least height along the vertex normal over the connected neighbourhood."""

    Parameters = HeightDiffParameters
    parameters: HeightDiffParameters
    unit = "m"
    cacheable = True

    @property
    def lethal_for_good(self) -> LethalArray:
        """Above ``threshold`` on the map as it is."""
        return self.costs > self.parameters.threshold

    @classmethod
    def reach(cls, parameters: HeightDiffParameters) -> float:
        """From the vertex to the edge of the cylinder; unknown if that has no height."""
        return math.hypot(parameters.radius, parameters.height_limit)

    def compute(self) -> tuple[CostArray, LethalArray]:
        """Cost = height difference [m], lethal above ``threshold`` less the error of a difference."""
        costs, settings = self._differences(), self.parameters
        return costs, costs > narrowed(settings.threshold, step_error(errors_for(self)), 0.0)

    def _differences(self) -> CostArray:
        """Height differences (V,) [m]; dense meshes by patches, which gives the same values."""
        mesh, lengths = self.topology, self.topology.neighbour_lengths
        surface = mesh.vertices, mesh.vertex_normals, mesh.neighbour_offsets, mesh.neighbours
        limits = self.parameters.radius, self.parameters.height_limit
        if len(lengths) == 0 or lengths.mean() * _DENSE > self.parameters.radius:
            return height_differences(*surface, *limits)
        patch_of, members, begins = grow_patches(mesh.vertices, mesh.neighbour_offsets, mesh.neighbours)
        bounds = bound_patches(mesh.vertices, mesh.vertex_normals, members, begins)
        borders = patch_borders(patch_of, mesh.neighbour_offsets, mesh.neighbours, len(bounds))
        return height_differences_by_patches(*surface, *limits, patch_of, members, begins, bounds, borders)
