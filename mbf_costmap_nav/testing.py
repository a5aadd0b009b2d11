"""The contract of costmap layers as a check that any layer author can call from their own tests.

>>> def test_my_layer_keeps_the_contract():
...     check_layer(MyLayer)

It raises one ``ContractBroken`` with everything it found. It does not check whether the costs are the right ones.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from mbf_abstract.geometry import Pose
from mbf_abstract.maps.layers.layer import LayerParameters
from mbf_abstract.maps.sensing import RangeScan
from mbf_abstract.testing.contract.report import ContractBroken, Report
from mbf_costmap_nav.grid.costmap import EMPTY_BOX, FREE, LETHAL, UNKNOWN, CellArray, CellBox, Costmap, GridGeometry
from mbf_costmap_nav.grid.footprint import Footprint
from mbf_costmap_nav.map.layer import CostmapLayer, LayerContext, shifted

__all__ = ["ContractBroken", "check_layer"]

COST_OF_LATER_LAYERS = 77
"""Marks cells outside the box, where layers after the checked one have written already."""
SEEN_AT = 1.0
"""Time [s] of the updates with scans."""
REACH = 8
"""Cells this near to a border or an area may take part in what happens there (a layer may inflate)."""

Scans = Sequence[RangeScan]


def check_layer(
    layer_class: type[CostmapLayer],
    *,
    parameters: LayerParameters | None = None,
    background: Costmap | None = None,
    scans: Scans = (),
    base_folder: Path | str = ".",
) -> None:
    """Check a costmap layer against the contract, with and without unknown space.

    Writes inside its box only, legal values, two instances that agree, updates that change nothing while nothing has
    changed, maps and scans left alone, parameters that can be set again, ``reset`` that drops scans,
    ``shift`` that keeps what stays in a rolling window and drops what leaves it, ``clear_area`` that clears the area
    and nothing else. Cells within 8 of a border or an area are left out of the last two, for layers that inflate costs.

    Parameters
    ----------
    parameters : LayerParameters, optional
        The class's defaults if not given.
    background : Costmap, optional
        What the layers before it have written, and the map of a static layer; a hall of 6 m x 4 m if not given.
    scans : sequence of RangeScan
        What the sources of a sensor layer see, in the frame of the map, with stamps around 1 s.
    base_folder : path
        Where relative file names in the parameters start.

    Raises
    ------
    ContractBroken
        With everything that is wrong.
    """
    hall = _hall() if background is None else background
    seen = [array for scan in scans for array in (scan.ends, scan.hits)]
    report = Report(layer_class, [hall.cells, *seen])
    chosen = layer_class.Parameters() if parameters is None else parameters
    for track_unknown_space in (False, True):

        def make(rolling: bool = False, unknown: bool = track_unknown_space) -> _Site:
            context = LayerContext(
                "dut", chosen, hall.frame_id, rolling, unknown, base_folder=Path(base_folder), static_map=hall
            )
            return _Site(layer_class(context), hall, report)

        with report.no_exception("construction"):
            site, twin = make(), make()
            with report.no_exception("updating"):
                _check_updates(site, twin, report)
            with report.no_exception("sensing"):
                _check_sensing(site, twin, scans, report)
            with report.no_exception("moving the window"):
                _check_shift(make(rolling=True), make(rolling=True), scans, report)
            with report.no_exception("clearing an area"):
                _check_clear_area(make, scans, report)
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
    site.layer.parameters_changed()
    again = site.update("update with the same parameters", everything, 0.0)
    report.expect(np.array_equal(again, first), "the same parameters, set at run time, gave other cells")


def _check_sensing(site: _Site, twin: _Site, scans: Scans, report: Report) -> None:
    """Hand over scans and reset; the state without sensors must come back."""
    everything = site.layer.geometry.box
    unseen = site.update("update without scans", everything, 0.0)
    seen = site.see(scans)
    report.expect(np.array_equal(seen, twin.see(scans)), "update with scans: two instances wrote different cells")
    whole = site.update("whole update with scans", everything, SEEN_AT)
    report.expect(np.array_equal(whole, seen), "update_bounds returned a box that misses changed cells")
    problem = site.layer.stale_reason(SEEN_AT)
    report.expect(isinstance(problem, str), f"stale_reason returned {type(problem).__name__}, not a text")
    site.layer.reset()
    reset = site.update("update after reset", everything, SEEN_AT)
    report.expect(np.array_equal(reset, unseen), "reset did not bring back the state without sensors")


def _check_shift(site: _Site, fresh: _Site, scans: Scans, report: Report) -> None:
    """Move the window a little, then out of sight of everything that was seen."""
    site.update("update of a rolling window", site.layer.geometry.box, 0.0)
    before = site.see(scans)
    dx, dy = 3, -2
    site.shift(dx, dy)
    after = site.update("update after shift", site.layer.geometry.box, SEEN_AT)
    height, width = after.shape
    inner = CellBox(REACH, REACH - dy, width - dx - REACH, height - REACH)
    stayed = before[inner.y0 + dy : inner.y1 + dy, inner.x0 + dx : inner.x1 + dx]
    same = inner.empty or np.array_equal(after[inner.slices], stayed)
    report.expect(same, "shift: cells changed that stayed in the window")
    site.shift(10 * width, 0)
    fresh.shift(dx + 10 * width, dy)
    fresh.layer.match_geometry(fresh.layer.geometry)
    away = site.update("update far away", site.layer.geometry.box, SEEN_AT)
    new = fresh.update("update far away", fresh.layer.geometry.box, SEEN_AT)
    report.expect(np.array_equal(away, new), "shift: what left the window was not forgotten")


def _check_clear_area(make: Callable[[], _Site], scans: Scans, report: Report) -> None:
    """Clear the left half, and all but the left half: one part is cleared, the other stays."""
    for inside in (True, False):
        site, name = make(), f"clear_area(inside={inside})"
        grid = site.layer.geometry.box
        unseen = site.update("update before clear_area", grid, 0.0)
        seen = site.see(scans)
        half = grid.x1 // 2
        site.layer.clear_area(CellBox(grid.x0 - 5, grid.y0 - 5, half, grid.y1 + 5), inside)  # may reach beyond the grid
        after = site.update(f"update after {name}", grid, SEEN_AT)
        left, right = np.s_[:, : half - REACH], np.s_[:, half + REACH :]
        area, rest = (left, right) if inside else (right, left)
        forgotten = (after == unseen) | (after == site.background)
        report.expect(bool(forgotten[area].all()), f"{name}: the area still shows what was seen there")
        report.expect(np.array_equal(after[rest], seen[rest]), f"{name}: cells out of the area changed")


class _Site:
    """The part of a layered costmap that one layer sees: cells, a box, and what was written before it."""

    def __init__(self, layer: CostmapLayer, hall: Costmap, report: Report) -> None:
        self.layer = layer
        self.report = report
        self.pose = Pose.planar(*hall.cell_to_world(hall.width // 2, hall.height // 2), frame_id=hall.frame_id)
        self.background = hall.cells.copy()
        if not layer.track_unknown_space:
            self.background[self.background == UNKNOWN] = FREE
        self.cells = self.background.copy()
        layer.match_geometry(hall.geometry)
        layer.set_footprint(Footprint.circle(0.2), Footprint.circle(0.2))

    def see(self, scans: Scans) -> CellArray:
        """Hand all scans to a layer that listens and update what it reports."""
        for scan in scans:
            if self.layer.listens_to(scan.source):
                self.layer.insert_scan(scan)
        return self.update("update with scans", EMPTY_BOX, SEEN_AT)

    def shift(self, dx: int, dy: int) -> None:
        """Move the window as a layered costmap does; free space comes into view."""
        old = self.layer.geometry
        new = GridGeometry(
            old.width,
            old.height,
            old.resolution,
            old.origin_x + dx * old.resolution,
            old.origin_y + dy * old.resolution,
        )
        self.layer.shift(new, dx, dy)
        self.report.expect(self.layer.geometry == new, "shift: the layer did not take over the new grid")
        self.background, self.cells = shifted(self.background, dx, dy, FREE), shifted(self.cells, dx, dy, FREE)

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


def _hall() -> Costmap:
    """Free space with a wall, a grey area, a lone cell and an unknown corner.

    The resolution is a power of two, so that a moved window rounds no point into another cell.
    """
    cells = np.full((32, 48), FREE, dtype=np.uint8)
    cells[:20, 16] = LETHAL
    cells[24:28, 24:32] = 100
    cells[8, 36] = LETHAL
    cells[24:, 40:] = UNKNOWN
    return Costmap(cells, 0.125)
