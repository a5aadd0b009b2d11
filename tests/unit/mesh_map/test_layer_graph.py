"""Order, refusals and updates of the layer graph, and the combinations."""

import numpy as np
import pytest

from mbf_abstract.maps.layers.layer_list import LayerListError, dependency_order
from mbf_abstract.parameters import parameter
from mbf_mesh_nav.arrays import IntArray, sorted_once
from mbf_mesh_nav.layers.border import BorderLayer
from mbf_mesh_nav.layers.combinations.max_combination import MaxCombinationLayer
from mbf_mesh_nav.layers.combinations.mean import MeanLayer
from mbf_mesh_nav.layers.combinations.weighted_sum import WeightedSumLayer
from mbf_mesh_nav.map.layer import NOTHING_CHANGED, LayerContext, LayerParameters, MeshLayer
from mbf_mesh_nav.map.layer_graph import LayerGraph, union_of
from mbf_mesh_nav.map.mesh_map import MeshMap

MESH = MeshMap.from_heights(np.zeros((4, 5)), 1.0, 1.0)
EVERYTHING = np.arange(20, dtype=np.int32)


class GivenLayer(MeshLayer):
    """A layer whose values the test sets."""

    def compute(self):
        return self._costs.copy(), self._lethal.copy()

    def give(self, costs, lethal=()) -> IntArray:
        flags = np.zeros(20, dtype=np.bool_)
        flags[list(lethal)] = True
        return self.replace(np.full(20, costs, dtype=np.float32), flags)


class CountingLayer(MaxCombinationLayer):
    """Counts how often it is asked to follow its inputs."""

    updates = 0

    def update_from_inputs(self, changed):
        self.updates += 1
        return super().update_from_inputs(changed)


def make(layer_class, name, *inputs, **parameters):
    settings = layer_class.Parameters(**parameters)
    layer = layer_class(LayerContext(name, MESH.topology, MESH.locator, settings, inputs))
    layer.recompute()
    return layer


def diamond():
    top = make(GivenLayer, "top")
    left, right = make(MaxCombinationLayer, "left", top), make(MaxCombinationLayer, "right", top)
    bottom = make(CountingLayer, "bottom", left, right)
    return LayerGraph([top, left, right, bottom]), top, bottom


def event_of(layer, event):
    return lambda visited: event() if visited is layer else NOTHING_CHANGED


def test_inputs_come_first_in_the_order():
    order = dependency_order(
        {"final": ["inflation", "obstacle"], "inflation": ["border"], "border": [], "obstacle": []}
    )

    assert order.index("border") < order.index("inflation") < order.index("final")
    assert order.index("obstacle") < order.index("final")


def test_all_unknown_inputs_are_named():
    with pytest.raises(LayerListError, match=r"a reads unknown layer 'x'; b reads unknown layer 'y'.*a, b"):
        dependency_order({"a": ["x"], "b": ["y", "a"]})


def test_a_cycle_is_named_beside_unknown_inputs():
    with pytest.raises(LayerListError, match=r"a reads unknown layer 'x'.*cycle: b -> c -> b"):
        dependency_order({"a": ["x"], "b": ["c"], "c": ["b", "a"]})


@pytest.mark.parametrize(
    ("inputs", "cycle"),
    [
        ({"a": ["a"]}, "a -> a"),
        ({"a": ["b"], "b": ["c"], "c": ["b"], "d": []}, "b -> c -> b"),
        ({"end": ["a"], "a": ["b", "d"], "b": ["a"], "d": []}, "a -> b -> a"),
    ],
)
def test_cycle_is_refused_and_spelled_out(inputs, cycle):
    with pytest.raises(LayerListError, match=cycle):
        dependency_order(inputs)


def test_values_of_a_layer_are_refused_unless_there_is_one_for_each_vertex():
    layer = make(GivenLayer, "mine")
    layer.give(0.5)
    with pytest.raises(ValueError, match=r"layer 'mine' gives costs of shape \(20, 1\), expected \(20,\)"):
        layer.replace(np.zeros((20, 1)), np.zeros(20, dtype=np.bool_))
    with pytest.raises(ValueError, match=r"layer 'mine' gives lethal flags of shape \(2,\), expected \(20,\)"):
        layer.replace(np.zeros(20), np.array([3, 4]))
    assert (layer.costs == 0.5).all()


class FailingLayer(MaxCombinationLayer):
    """Raises while the test wants it to."""

    fails = False
    error: BaseException = RuntimeError("no idea")

    def update_from_inputs(self, changed):
        if self.fails:
            raise self.error
        return super().update_from_inputs(changed)


@pytest.mark.parametrize("error", [RuntimeError("no idea"), SystemExit("no idea"), GeneratorExit("no idea")])
def test_what_changed_before_a_layer_raised_is_handed_on_by_the_next_pass(error):
    top = make(GivenLayer, "top")
    failing = make(FailingLayer, "failing", top)
    below, beside = make(MaxCombinationLayer, "below", failing), make(MaxCombinationLayer, "beside", top)
    graph = LayerGraph([top, failing, below, beside])
    failing.fails, failing.error = True, error
    with pytest.raises(type(error), match="no idea"):
        graph.apply(event_of(top, lambda: top.give(0.7, [3])))
    assert graph.problem == f"layer 'failing' raised {type(error).__name__}: no idea"

    failing.fails = False
    changed = graph.apply(lambda layer: NOTHING_CHANGED)

    assert graph.problem == ""
    for layer in (failing, below, beside):
        np.testing.assert_array_equal(layer.costs, top.costs)
        assert layer.lethal[3]
        np.testing.assert_array_equal(changed[layer.name], EVERYTHING)
    assert graph.apply(lambda layer: NOTHING_CHANGED) == {}


class BreakingLayer(FailingLayer):
    """Leaves its values broken when it raises."""

    def update_from_inputs(self, changed):
        if self.fails:
            self._costs = np.full(20, 0.1, dtype=np.float32)
        return super().update_from_inputs(changed)


def test_a_layer_that_raised_starts_over_even_if_another_one_raises_in_between():
    first, second = make(GivenLayer, "first"), make(GivenLayer, "second")
    failing, breaking = make(FailingLayer, "failing", first), make(BreakingLayer, "breaking", second)
    graph = LayerGraph([first, second, failing, breaking])
    breaking.fails = True
    with pytest.raises(RuntimeError, match="no idea"):
        graph.apply(event_of(second, lambda: second.give(0.0, [3])))
    failing.fails, breaking.fails = True, False
    with pytest.raises(RuntimeError, match="no idea"):
        graph.apply(event_of(first, lambda: first.give(0.6)))
    failing.fails = False

    graph.apply(lambda layer: NOTHING_CHANGED)

    np.testing.assert_array_equal(breaking.costs, second.costs)
    np.testing.assert_array_equal(breaking.lethal, second.lethal)


class PartLayer(MeshLayer):
    """The costs of its input at the first so many vertices."""

    class Parameters(LayerParameters):
        """Parameters of the layer."""

        size: int = parameter(20, "Number of vertices.")

    inputs_allowed = (1, 1)

    def compute(self):
        costs = np.where(EVERYTHING < self.parameters.size, self.inputs[0].costs, 0.0).astype(np.float32)
        return costs, np.zeros(20, dtype=np.bool_)


def test_what_putting_parameters_back_changes_is_handed_on_by_the_next_pass():
    top = make(GivenLayer, "top")
    interrupted, part = make(FailingLayer, "interrupted", top), make(PartLayer, "part", top, size=10)
    below, failing = make(MaxCombinationLayer, "below", part), make(FailingLayer, "failing", top)
    graph = LayerGraph([top, interrupted, part, below, failing])
    interrupted.fails = True
    with pytest.raises(RuntimeError, match="no idea"):
        graph.apply(event_of(top, lambda: top.give(0.7)))
    interrupted.fails, failing.fails = False, True
    with pytest.raises(RuntimeError, match="no idea"):
        graph.set_parameters("part", PartLayer.Parameters(size=5))
    failing.fails = False

    graph.apply(lambda layer: NOTHING_CHANGED)

    np.testing.assert_array_equal(part.costs, np.where(EVERYTHING < 10, top.costs, 0.0))
    np.testing.assert_array_equal(below.costs, part.costs)


def test_parameters_that_a_layer_further_down_cannot_take_are_put_back():
    top = make(BorderLayer, "top", border_cost=0.9)
    failing = make(FailingLayer, "failing", top)
    graph = LayerGraph([top, failing])
    usual, costs = top.parameters, top.costs.copy()
    failing.fails = True
    with pytest.raises(RuntimeError, match="no idea"):
        graph.set_parameters("top", BorderLayer.Parameters(border_cost=2.0))
    assert top.parameters == usual
    np.testing.assert_array_equal(top.costs, costs)


def test_layer_below_a_diamond_is_updated_once_per_event():
    graph, top, bottom = diamond()

    changed = graph.apply(event_of(top, lambda: top.give(0.7, lethal=[3])))

    assert bottom.updates == 1
    assert set(changed) == {"top", "left", "right", "bottom"}
    np.testing.assert_allclose(bottom.costs, 0.7)
    assert np.flatnonzero(bottom.lethal).tolist() == [3]


def test_only_changed_vertices_are_handed_down():
    graph, top, _ = diamond()

    def one_vertex():
        costs = top.costs.copy()
        costs[5] = 2.0
        return top.replace(costs, top.lethal.copy())

    changed = graph.apply(event_of(top, one_vertex))

    assert {name: vertices.tolist() for name, vertices in changed.items()} == {name: [5] for name in graph}


def test_event_that_changes_nothing_visits_no_layer_below():
    graph, top, bottom = diamond()

    assert graph.apply(event_of(top, lambda: top.give(0.0))) == {}
    assert bottom.updates == 0


def test_combinations_merge_costs_and_unite_lethal_flags():
    a, b = make(GivenLayer, "a", combination_weight=2.0), make(GivenLayer, "b", combination_weight=0.5)
    a.give(0.25, lethal=[1])
    b.give(0.5, lethal=[2])
    expected = {MaxCombinationLayer: 0.5, WeightedSumLayer: 0.75, MeanLayer: 0.3}

    for layer_class, cost in expected.items():
        layer = make(layer_class, "merged", a, b)
        np.testing.assert_allclose(layer.costs, cost)
        assert np.flatnonzero(layer.lethal).tolist() == [1, 2]


def test_input_of_weight_zero_plays_no_part_even_if_it_is_infinite():
    a, b = make(GivenLayer, "a", combination_weight=0.0), make(GivenLayer, "b")
    a.give(np.inf)
    b.give(0.5)

    for layer_class in (WeightedSumLayer, MeanLayer):
        np.testing.assert_allclose(make(layer_class, "merged", a, b).costs, 0.5)


def test_new_combination_weight_reaches_the_sum():
    given = make(GivenLayer, "given")
    given.give(1.0)
    total = make(WeightedSumLayer, "total", given)
    graph = LayerGraph([given, total])

    changed = graph.set_parameters("given", LayerParameters(combination_weight=3.0))

    np.testing.assert_allclose(total.costs, 3.0)
    assert changed["total"].tolist() == EVERYTHING.tolist()


def test_values_of_a_layer_cannot_be_written_from_outside():
    layer = make(GivenLayer, "given")

    with pytest.raises(ValueError, match="read-only"):
        layer.costs[0] = 1.0
    with pytest.raises(ValueError, match="read-only"):
        layer.lethal[0] = True


@pytest.mark.parametrize("sets", [[], [[]], [[3, 5]], [[1, 4], [], [2, 4]], [[7], [7], [0, 7, 9]]])
def test_the_union_of_changes_names_each_vertex_once_and_in_order(sets):
    union = union_of([np.array(vertices, dtype=np.int32) for vertices in sets])
    assert union.dtype == np.int32 and union.tolist() == sorted(set().union(*sets))


@pytest.mark.parametrize("shape", [(0,), (0, 3), (1,), (40,), (30, 3)])
def test_sorted_once_is_the_set_of_the_numbers_in_order(shape):
    numbers = np.random.default_rng(4).integers(0, 20, shape).astype(np.int32)

    found = sorted_once(numbers)

    assert found.dtype == np.int32 and found.tolist() == sorted(set(numbers.ravel().tolist()))
