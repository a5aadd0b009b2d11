"""The contract of costmap layers as a check that any layer author can call from their own tests.

>>> def test_my_layer_keeps_the_contract():
...     check_layer(MyLayer)

It raises one ``ContractBroken`` with everything it found. Whether the costs are the right ones it cannot know.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from mbf_abstract.geometry import Pose
from mbf_abstract.testing.contract.report import ContractBroken, Report
from mbf_costmap_nav.costmap import EMPTY_BOX, FREE, LETHAL, UNKNOWN, CellArray, CellBox, Costmap
from mbf_costmap_nav.footprint import Footprint
from mbf_costmap_nav.layer import CostmapLayer, LayerContext, LayerParameters
from mbf_costmap_nav.sensor_data import Observation, SensorLayer

__all__ = ["ContractBroken", "check_layer"]

COST_OF_LATER_LAYERS = 77
"""Stands out of the box, where layers after the checked one have written already."""

Observations = Sequence[tuple[str, Observation]]


def check_layer(
    layer_class: type[CostmapLayer],
    *,
    parameters: LayerParameters | None = None,
    background: Costmap | None = None,
    observations: Observations = (),
    base_folder: Path | str = ".",
) -> None:
    """Check a costmap layer against the contract, with and without unknown space.

    Writes inside its box only, legal values, two instances that agree, updates that change nothing while nothing has
    changed, maps and observations left alone, parameters that can be set again, ``reset`` that forgets observations.

    Parameters
    ----------
    layer_class : type
    parameters : LayerParameters, optional
        The class's defaults if not given.
    background : Costmap, optional
        What the layers before it have written, and the map of a static layer; a room of 6 m x 4 m if not given.
    observations : sequence of (source, Observation)
        What the sources of a sensor layer see, with stamps around 1 s.
    base_folder : path
        Where relative file names in the parameters start.

    Raises
    ------
    ContractBroken
        With everything that is wrong.
    """
    room = _room() if background is None else background
    seen = [array for _, observation in observations for array in (observation.ends, observation.hits)]
    report = Report(layer_class, [room.cells, *seen])
    chosen = layer_class.Parameters() if parameters is None else parameters
    for track_unknown_space in (False, True):
        context = LayerContext(
            "dut", chosen, room.frame_id, False, track_unknown_space, base_folder=Path(base_folder), static_map=room
        )
        with report.no_exception("construction"):
            site = _Site(layer_class(context), room, report)
            twin = _Site(layer_class(context), room, report)
            with report.no_exception("updating"):
                _check_updates(site, twin, report)
            with report.no_exception("sensing"):
                _check_sensing(site, twin, observations, report)
    report.finish()


def _check_updates(site: _Site, twin: _Site, report: Report) -> None:
    """Update everything, nothing and a part; nothing has changed in between."""
    everything = site.layer.geometry.box
    first = site.update("first update", everything, 0.0)
    same = np.array_equal(first, twin.update("first update", everything, 0.0))
    report.expect(same, "first update: two instances wrote different cells")
    middle = CellBox(everything.x1 // 3, everything.y1 // 3, 2 * everything.x1 // 3, 2 * everything.y1 // 3)
    for situation, box in (("second update", everything), ("update of nothing", EMPTY_BOX), ("part update", middle)):
        again = site.update(situation, box, 0.0)
        report.expect(np.array_equal(again, first), f"{situation}: cells changed although nothing else had")
    site.layer.parameters = site.layer.parameters.model_copy(deep=True)
    again = site.update("update with the same parameters", everything, 0.0)
    report.expect(np.array_equal(again, first), "the same parameters, set at run time, gave other cells")


def _check_sensing(site: _Site, twin: _Site, observations: Observations, report: Report) -> None:
    """Hand over observations and reset; the state without sensors must come back."""
    everything = site.layer.geometry.box
    unseen = site.update("update without observations", everything, 0.0)
    for place in (site, twin):
        if isinstance(place.layer, SensorLayer):
            for source, observation in observations:
                place.layer.insert(source, observation)
    seen = site.update("update with observations", EMPTY_BOX, 1.0)
    same = np.array_equal(seen, twin.update("update with observations", EMPTY_BOX, 1.0))
    report.expect(same, "update with observations: two instances wrote different cells")
    whole = site.update("whole update with observations", everything, 1.0)
    report.expect(np.array_equal(whole, seen), "update_bounds returned a box that misses changed cells")
    problem = site.layer.currency_problem(1.0)
    report.expect(isinstance(problem, str), f"currency_problem returned {type(problem).__name__}, not a text")
    site.layer.reset()
    reset = site.update("update after reset", everything, 1.0)
    report.expect(np.array_equal(reset, unseen), "reset did not bring back the state without sensors")


class _Site:
    """The part of a layered costmap that one layer sees: cells, a box, and what was written before it."""

    def __init__(self, layer: CostmapLayer, room: Costmap, report: Report) -> None:
        self.layer = layer
        self.report = report
        self.pose = Pose.planar(*room.cell_to_world(room.width // 2, room.height // 2), frame_id=room.frame_id)
        self.background = room.cells.copy()
        if not layer.track_unknown_space:
            self.background[self.background == UNKNOWN] = FREE
        self.cells = self.background.copy()
        layer.match_geometry(room.geometry)
        layer.set_footprint(Footprint.circle(0.2))

    def update(self, situation: str, box: CellBox, now: float) -> CellArray:
        """Run both passes for a box that layers before it report; return a copy of all cells."""
        grid = self.layer.geometry.box
        reported = self.layer.update_bounds(self.pose, now, box)
        self.report.expect(reported.union(box) == reported, f"{situation}: update_bounds gave up cells of its box")
        own = reported.clipped(grid)
        if own.empty:
            return self.cells.copy()
        shared = np.full_like(self.cells, COST_OF_LATER_LAYERS)
        shared[own.slices] = self.background[own.slices]
        self.layer.update_costs(shared, own)
        self.cells[own.slices] = shared[own.slices]
        shared[own.slices] = COST_OF_LATER_LAYERS
        untouched = bool((shared == COST_OF_LATER_LAYERS).all())
        self.report.expect(untouched, f"{situation}: wrote outside its box")
        unknown = not self.layer.track_unknown_space and bool((self.cells == UNKNOWN).any())
        self.report.expect(not unknown, f"{situation}: wrote 255 (unknown) into a map without unknown space")
        return self.cells.copy()


def _room() -> Costmap:
    """Free space with a wall, a grey area, a lone cell and a corner nobody has seen."""
    cells = np.full((40, 60), FREE, dtype=np.uint8)
    cells[:25, 20] = LETHAL
    cells[30:34, 30:40] = 100
    cells[10, 45] = LETHAL
    cells[30:, 50:] = UNKNOWN
    return Costmap(cells, 0.1)
