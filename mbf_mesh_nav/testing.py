"""The contract of mesh layers as a check that any layer author can call from their own tests.

>>> def test_my_layer_keeps_the_contract():
...     check_layer(MyLayer, MeshMap.from_heights(heights, 0.1, 0.1))

It raises one ``ContractBroken`` with everything it found. Whether the costs are the right ones it cannot know.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import ArrayLike

from mbf_abstract.maps.sensing import RangeScan
from mbf_abstract.testing.contract.report import ContractBroken, Report
from mbf_mesh_nav.arrays import FloatArray, IntArray
from mbf_mesh_nav.map.layer import CostArray, LayerContext, LayerParameters, LethalArray, MeshLayer
from mbf_mesh_nav.map.mesh_map import MeshMap

__all__ = ["ContractBroken", "check_layer"]

Values = tuple[CostArray, LethalArray]


def check_layer(
    layer_class: type[MeshLayer],
    mesh_map: MeshMap,
    *,
    parameters: LayerParameters | None = None,
    inputs: Sequence[MeshLayer] = (),
    points: ArrayLike | None = None,
    sensor_origin: ArrayLike = (0.0, 0.0, 1.0),
) -> None:
    """Check a mesh layer against the contract.

    Legal values of the right shape, two instances that agree, a second computation that changes nothing, changes
    reported as they are, inputs and mesh left alone, parameters that can be set again, ``clear`` that drops points.

    Parameters
    ----------
    mesh_map : MeshMap
        A mesh on which the layer has an effect.
    parameters : LayerParameters, optional
        The class's defaults if not given.
    inputs : sequence of MeshLayer
        Computed layers of the same mesh, as many as the class requires.
    points : (n, 3) float, optional
        A cloud [m] in the map's frame, for layers that are fed by a sensor.
    sensor_origin : (3,) float
        Where it was seen from [m].

    Raises
    ------
    ContractBroken
        With everything that is wrong.
    ValueError
        The class does not take this number of inputs.
    """
    least, most = layer_class.inputs_allowed
    if not least <= len(inputs) <= most:
        raise ValueError(f"{layer_class.__qualname__} takes {least} to {most} inputs, got {len(inputs)}")
    cloud = np.zeros((0, 3)) if points is None else np.array(points, dtype=np.float64)
    arrays = [array for array in vars(mesh_map.topology).values() if isinstance(array, np.ndarray)]
    read = [array for layer in inputs for array in (layer.costs, layer.lethal)]
    report = Report(layer_class, [*arrays, *read, cloud])
    chosen = layer_class.Parameters() if parameters is None else parameters
    context = LayerContext("dut", mesh_map.topology, mesh_map.locator, chosen, tuple(inputs))
    with report.no_exception("construction"):
        check = _LayerCheck(layer_class(context), layer_class(context), report)
        with report.no_exception("computing"):
            check.computing()
        with report.no_exception("sensing"):
            check.sensing(cloud, np.array(sensor_origin, dtype=np.float64))
    report.finish()


class _LayerCheck:
    """Puts two instances of one layer through the same events."""

    def __init__(self, layer: MeshLayer, twin: MeshLayer, report: Report) -> None:
        self.layer = layer
        self.twin = twin
        self.report = report

    def computing(self) -> None:
        """Compute, compute again, and set the same parameters."""
        self._event("recompute", lambda layer: layer.recompute())
        computed = _values(self.layer)
        self._expect_legal("compute", *self.twin.compute())  # a layer converts what it takes over
        self._event("second recompute", lambda layer: layer.recompute())
        self._expect_same(computed, "a second recompute changed the values")
        if self.layer.inputs:
            everything = np.arange(self.layer.topology.vertex_count, dtype=np.int32)
            self._event("update_from_inputs", lambda layer: layer.update_from_inputs(everything))
            self._expect_same(computed, "update_from_inputs disagrees with recompute")
        self.layer.parameters = self.layer.parameters.model_copy(deep=True)
        self.layer.recompute()
        self._expect_same(computed, "the same parameters, set at run time, gave other values")

    def sensing(self, points: FloatArray, origin: FloatArray) -> None:
        """Hand over a cloud, let it expire, clear it; the state without sensors must come back."""
        unseen = _values(self.layer)
        scan = RangeScan("sensor", "map", origin, points, np.ones(len(points), dtype=np.bool_), 1.0)
        for layer in (self.layer, self.twin):
            layer.insert_scan(scan)
        self._expect_same(unseen, "insert_scan changed the values before an update")
        self._event("update", lambda layer: layer.update(1.0))
        seen = _values(self.layer)
        self._event("recompute after update", lambda layer: layer.recompute())
        self._expect_same(seen, "recompute lost what update had changed")
        self._event("second update", lambda layer: layer.update(2.0))
        self._event("clear", lambda layer: layer.clear())
        self._expect_same(unseen, "clear did not bring back the state without sensors")
        self.report.expect(isinstance(self.layer.stale_reason(2.0), str), "stale_reason returned no text")

    def _event(self, situation: str, event: Callable[[MeshLayer], IntArray]) -> None:
        """Apply an event to both instances and check what the first reports and holds."""
        before = _values(self.layer)
        changed = event(self.layer)
        event(self.twin)
        legal = self._expect_legal(situation, self.layer.costs, self.layer.lethal)
        same = self._expect_same(_values(self.twin), f"{situation}: two instances have different values")
        if legal and same:
            after = _values(self.layer)
            expected = np.flatnonzero((before[0] != after[0]) | (before[1] != after[1]))
            text = f"{situation}: the vertices it returned are not those that changed"
            self.report.expect(np.array_equal(changed, expected), text)

    def _expect_legal(self, situation: str, costs: CostArray, lethal: LethalArray) -> bool:
        count = self.layer.topology.vertex_count
        legal = True
        for name, array, dtype in (("costs", costs, np.float32), ("lethal", lethal, np.bool_)):
            good = array.shape == (count,) and array.dtype == dtype
            text = f"{situation}: {name} are {array.dtype} {array.shape}, expected {np.dtype(dtype)} {(count,)}"
            self.report.expect(good, text)
            legal = legal and good
        wrong = np.flatnonzero(~(costs >= 0.0))
        example = f"{costs[wrong[0]]} at vertex {wrong[0]}" if len(wrong) else ""
        self.report.expect(not len(wrong), f"{situation}: {len(wrong)} costs are NaN or negative, e.g. {example}")
        return legal and not len(wrong)

    def _expect_same(self, expected: Values, text: str) -> bool:
        same = all(map(np.array_equal, _values(self.layer), expected))
        self.report.expect(same, text)
        return same


def _values(layer: MeshLayer) -> Values:
    return layer.costs.copy(), layer.lethal.copy()
