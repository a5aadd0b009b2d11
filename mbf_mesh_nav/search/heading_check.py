"""Looks once more at paths of planners that know no headings, for headings that the tilt forbids.

The footprint of a ``tilt`` layer is swept along the path with the headings a follower has there: those of chords about
as long as a robot, for what zigzags in between is not driven. Where it uses more than its limits the ground is closed
and the leg planned again, a bounded number of times, each time with more of the ground closed that allows few headings.
Where no plan holds, the one that holds best is returned, with a note: a bad path is better than none.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from mbf_abstract.geometry.arithmetic import norm
from mbf_abstract.geometry.polyline import polyline_lengths
from mbf_mesh_nav.arrays import BoolArray, FloatArray, IntArray
from mbf_mesh_nav.kernels.layers.chassis import Scratch, scratch_for
from mbf_mesh_nav.kernels.layers.footprint_sweep import uses_along
from mbf_mesh_nav.layers.tilt import TiltLayer
from mbf_mesh_nav.map.mesh_map import MeshMap
from mbf_mesh_nav.mesh.positions import position_text
from mbf_mesh_nav.search.heading_limits import chassis_of
from mbf_mesh_nav.search.leg_search import Leg, LegQuery, points_at

SPACING = 0.1
"""Length [m] of the pieces of a path that are swept one by one."""
CHORD = 0.5
"""Length [m] of the chord that stands for the robot's heading in its middle."""
SHARES = (0.0, 0.0, 0.25, 0.5, 0.75, 0.75, 0.9, 0.9)
"""For each further search: ground that allows a smaller share of headings is closed, too."""
WORST_COUNTED = 2.0
"""A greater use counts as this when plans are compared; where a wheel has no ground it is infinite."""


class Refused(NamedTuple):
    """Where the tilt forbids the heading of a path: points (k, 3) [m], their vertices (k,), uses (k,) above 1."""

    points: FloatArray
    vertices: IntArray
    uses: FloatArray

    @property
    def amount(self) -> float:
        """How much is forbidden, to compare plans."""
        return float(np.add.accumulate(np.minimum(self.uses, WORST_COUNTED))[-1]) if len(self.uses) else 0.0


class HeadingCheck:
    """Checks the legs of one planner on one map."""

    def __init__(self, mesh_map: MeshMap) -> None:
        self._mesh_map = mesh_map
        self._some_forbidden: tuple[BoolArray, BoolArray] | None = None
        self._kept_scratch: Scratch | None = None

    def leg_that_holds(
        self, query: LegQuery, layer: TiltLayer, leg: Leg, plan_again: Callable[[LegQuery], Leg | None]
    ) -> Leg:
        """The leg if all of it is allowed, else the first other one that is, else the one with the least forbidden.

        Parameters
        ----------
        plan_again
            Plans the leg with more vertices blocked; None if there is no path.
        """
        best, least = leg, self.refused(query, layer, leg)
        closed, refused = query.blocked, least
        for share in SHARES:
            if not len(refused.uses) or query.cancel_flag[0]:
                break
            closed = closed.copy()
            closed[refused.vertices] = True
            narrow = self._allow_less(layer, share)
            narrow[self._mesh_map.faces[[query.start.face, query.goal.face]]] = False
            other = plan_again(replace(query, blocked=closed | narrow))
            if other is None:
                other = plan_again(replace(query, blocked=closed))
            if other is None:
                break
            refused = self.refused(query, layer, other)
            if refused.amount < least.amount:
                best, least = other, refused
        if not len(least.uses):
            return best
        worst = int(np.argmax(least.uses))
        text = (
            f"the tilt forbids the heading at {len(least.uses)} places of the path, most at "
            f"{position_text(least.points[worst])} ({least.uses[worst]:.2f} of the limit)"
        )
        return replace(best, note="; ".join(filter(None, (best.note, text))))

    def refused(self, query: LegQuery, layer: TiltLayer, leg: Leg) -> Refused:
        """Where the tilt forbids to drive along a leg; the faces of its ends do not count, they cannot be avoided."""
        mesh_map, lengths = self._mesh_map, polyline_lengths(leg.positions)
        count = max(int(np.ceil(lengths[-1] / SPACING)), 1)
        at = np.linspace(0.0, lengths[-1], count + 1)
        middles = 0.5 * (at[:-1] + at[1:])
        points = points_at(leg.positions, lengths, at)
        spots = mesh_map.locate(points_at(leg.positions, lengths, middles))
        corners = mesh_map.faces[spots.faces]
        vertices = corners[np.arange(count), np.argmax(spots.barycentric, axis=1)]
        ends = mesh_map.faces[[query.start.face, query.goal.face]]
        looked_at = self._forbid_some(layer)[corners].any(axis=1) & (vertices[:, None] != ends.ravel()).all(axis=1)
        places = np.flatnonzero(looked_at)
        chords = points_at(leg.positions, lengths, middles[places] + 0.5 * CHORD)
        chords -= points_at(leg.positions, lengths, middles[places] - 0.5 * CHORD)
        flat = norm(chords[:, :2])
        places, chords = places[flat > 0.0], (chords[:, :2] / flat[:, None])[flat > 0.0]
        sweep = spots.faces[places], points[places], points[places + 1], chords
        uses = uses_along(mesh_map.topology.surface, chassis_of(layer), self._scratch(), *sweep)
        beyond = uses > 1.0
        places = places[beyond]
        return Refused(spots.points[places], vertices[places], uses[beyond])

    def _scratch(self) -> Scratch:
        """Memory for sweeps: a planner belongs to one thread at a time."""
        if self._kept_scratch is None or len(self._kept_scratch.seen) != len(self._mesh_map.vertices):
            self._kept_scratch = scratch_for(len(self._mesh_map.vertices))
        return self._kept_scratch

    def _allow_less(self, layer: TiltLayer, share: float) -> BoolArray:
        """Vertices (V,) that allow less than a share of the headings."""
        return np.asarray(np.count_nonzero(layer.allowed, axis=1) < share * layer.allowed.shape[1])

    def _forbid_some(self, layer: TiltLayer) -> BoolArray:
        """Vertices (V,) where a heading is not allowed: elsewhere nothing needs to be swept."""
        if self._some_forbidden is None or self._some_forbidden[0] is not layer.allowed:
            self._some_forbidden = layer.allowed, np.asarray(~layer.allowed.all(axis=1))
        return self._some_forbidden[1]
