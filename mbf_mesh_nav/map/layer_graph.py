"""The layers of a mesh map in the order of their dependencies, and one pass through them per event.

An event (a point cloud, an expiry, a changed parameter) changes some vertices of one or more layers. The graph then
visits every layer once, inputs first, and hands it the union of what its inputs changed; a layer below a diamond is
therefore computed once, not once per path.

A layer that raises ends the pass. What had changed by then is not lost: the next pass hands it on, and begins by
computing every layer anew that raised since the last one that came through. Until then ``problem`` says that the layers
are not up to date.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from mbf_abstract.maps.layers.layer_stack import LayerStack
from mbf_mesh_nav.arrays import IntArray, sorted_once
from mbf_mesh_nav.map.layer import NOTHING_CHANGED, LayerParameters, MeshLayer


class LayerGraph(LayerStack[MeshLayer]):
    """The layers by name, ``graph["inflation"].costs``; see the module's text for how changes travel.

    Parameters
    ----------
    layers : sequence of MeshLayer
        Inputs before the layers that read them, computed or not.
    """

    def __init__(self, layers: Sequence[MeshLayer] = ()) -> None:
        super().__init__(layers)
        self._interrupted: set[str] = set()  # names of the layers that raised in passes that did not come through
        self._owed: dict[str, IntArray] = {}  # what passes changed that did not come through

    def apply(self, event: Callable[[MeshLayer], IntArray]) -> dict[str, IntArray]:
        """Give an event to every layer, then let the changes run down once.

        Parameters
        ----------
        event : callable
            Called once with every layer, inputs first; returns the vertices it changed by itself.

        Returns
        -------
        dict
            Changed vertices, ascending int32, for every layer that changed.

        Raises
        ------
        Exception
            Whatever a layer raises; see the module's text.
        """
        changed = dict(self._owed)
        for name, layer in self._layers.items():
            from_inputs = union_of([changed[read.name] for read in layer.inputs if read.name in changed])
            try:
                followed, by_event = self._follow(layer, from_inputs), _vertices(layer, event(layer))
                own = union_of([changed.get(name, NOTHING_CHANGED), followed, by_event])
            except BaseException as error:  # also a sys.exit()
                self.note(layer, error)
                self._interrupted.add(name)
                self._owed = changed
                raise
            if len(own):
                changed[name] = own
        self.problem, self._interrupted, self._owed = "", set(), {}
        return changed

    def _follow(self, layer: MeshLayer, from_inputs: IntArray) -> IntArray:
        """Let a layer react to what its inputs changed; one that raised starts over."""
        if layer.name in self._interrupted:
            layer.recompute()
            return np.arange(len(layer.costs), dtype=np.int32)
        follows = layer.parameters.enabled and len(from_inputs)
        return _vertices(layer, layer.update_from_inputs(from_inputs)) if follows else NOTHING_CHANGED

    def set_parameters(self, name: str, parameters: LayerParameters) -> dict[str, IntArray]:
        """Change a layer's parameters at run time and recompute what depends on them; returns as ``apply``.

        A combination reads the weights of its inputs, so a new ``combination_weight`` counts as a change of every
        vertex of the layer.

        Raises
        ------
        TypeError
            The parameters are those of another type of layer.
        Exception
            Whatever the layer, or one that reads it, raises that cannot compute with them; it keeps the old ones.
        """
        layer = self[name]
        old = layer.parameters
        if not isinstance(parameters, type(old)):
            raise TypeError(f"layer '{name}' takes {type(old).__name__}, got {type(parameters).__name__}")
        layer.parameters = parameters
        try:
            changed = layer.recompute()
            if old.combination_weight != parameters.combination_weight:
                changed = np.arange(len(layer.costs), dtype=np.int32)
            return self.apply(lambda visited: changed if visited is layer else NOTHING_CHANGED)
        except BaseException:
            layer.parameters = old
            # Not always what the new ones had changed: inputs may have changed in the same pass.
            restored = layer.recompute()
            if len(restored):
                self._owed[name] = union_of([self._owed.get(name, NOTHING_CHANGED), restored])
            raise


def _vertices(layer: MeshLayer, changed: object) -> IntArray:
    """The vertices that a layer says it has changed, ascending without repetitions.

    Raises
    ------
    TypeError, IndexError
        It returned something else, or vertices that the mesh does not have.
    """
    if changed is NOTHING_CHANGED:
        return NOTHING_CHANGED
    vertices, count = np.asarray(changed), layer.topology.vertex_count
    if vertices.ndim != 1 or (len(vertices) and vertices.dtype.kind not in "iu"):
        got = f"{type(changed).__name__} of shape {vertices.shape}, type {vertices.dtype}"
        raise TypeError(f"a layer returns the vertices (k,) int that have changed, got {got}")
    if np.count_nonzero(vertices[1:] > vertices[:-1]) < len(vertices) - 1:
        vertices = np.unique(vertices)
    if len(vertices) and not (vertices[0] >= 0 and vertices[-1] < count):
        raise IndexError(
            f"vertices {vertices[0]} to {vertices[-1]} have changed, but the mesh has only 0 to {count - 1}"
        )
    return vertices.astype(np.int32, copy=False)


def union_of(sets: Sequence[IntArray]) -> IntArray:
    """Vertices (k,) int32 in any of the sets, each of which is ascending without repetitions, as is the result."""
    filled = [changed for changed in sets if len(changed)]
    if len(filled) < 2:
        return filled[0] if filled else NOTHING_CHANGED
    return sorted_once(np.concatenate(filled))
