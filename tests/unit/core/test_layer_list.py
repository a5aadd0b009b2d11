"""The list of a map's layers: loading, checking, ordering, and what all layers are asked together."""

import pytest

from mbf_abstract.maps.layers.layer import LayerParameters, MapLayer
from mbf_abstract.maps.layers.layer_list import LayerEntry, LayerListError, plan_layers
from mbf_abstract.maps.layers.layer_stack import LayerStack
from mbf_abstract.maps.layers.source_watch import SourceWatch
from mbf_abstract.maps.sensing import RangeScan


class Reading(LayerEntry):
    """An entry that reads other layers."""

    inputs: tuple[str, ...] = ()

    @property
    def reads(self):
        return self.inputs


class Eyes(MapLayer):
    """A layer with two sources and something to say about both."""

    source_names = ("left", "right")

    def stale_reason(self, now):
        return f"nothing seen at {now:g} s"

    def configuration_warning(self):
        return "one eye would do"


def stack(**enabled):
    return LayerStack([Eyes(name, LayerParameters(enabled=on)) for name, on in enabled.items()])


def test_layers_come_after_those_they_read_and_else_in_the_configured_order():
    entries = [Reading(name="sum", type="x", inputs=("b", "a")), *(Reading(name=n, type="x") for n in "cab")]
    planned = plan_layers(entries, {}, lambda _: Eyes)
    assert [one.entry.name for one in planned] == ["c", "a", "b", "sum"]


def test_all_findings_of_a_list_come_in_one_error():
    entries = [Reading(name="a", type="x", inputs=("z",)), Reading(name="a", type="x")]
    with pytest.raises(LayerListError) as error:
        plan_layers(entries, {"b": {}, "a": {"enabled": "perhaps"}}, lambda _: Eyes, lambda planned: ["never asked"])
    text = str(error.value)
    for part in ("'a' is used twice", "parameters for 'b', but no such layer", "layer 'a': enabled: Input should"):
        assert part in text
    assert "never asked" not in text  # a check sees valid parameters only


def test_validated_parameters_are_taken_as_they_are():
    given = LayerParameters(enabled=False)
    (planned,) = plan_layers([LayerEntry(name="a", type="x")], {"a": given}, lambda _: Eyes)
    assert planned.parameters is given


def test_disabled_layers_are_neither_stale_nor_warned_of():
    assert stack(a=False, b=True).stale_reason(2.0) == "layer 'b': nothing seen at 2 s"
    assert stack(a=False).stale_reason(2.0) == ""
    assert stack(a=False, b=True).configuration_warnings() == ["layer 'b': one eye would do"]


def test_a_stack_names_the_known_layers():
    layers = stack(a=True, b=True)
    assert [layer.name for layer in layers.chosen(None)] == ["a", "b"]
    with pytest.raises(KeyError, match=r"no layer 'c', only \['a', 'b'\]"):
        layers.chosen(["a", "c"])
    with pytest.raises(LayerListError, match="need different names"):
        LayerStack([*layers.values(), layers["a"]])


def test_a_source_is_fresh_only_while_it_speaks_and_is_in_the_map():
    watch = SourceWatch("lidar")
    assert "has not sent anything" in watch.stale_reason(0.0, 1.0) and watch.stale_reason(0.0, 0.0) == ""
    watch.heard(1.0)
    assert "nothing of observation source 'lidar' is in the map" in watch.stale_reason(1.5, 1.0)
    watch.used()
    assert watch.stale_reason(1.5, 1.0) == ""
    assert "silent for 1.50 s, expected every 1.00 s" in watch.stale_reason(2.5, 1.0)
    assert "2.00 s in the future" in watch.stale_reason(-1.0, 1.0)
    watch.cleared()
    assert watch.stale_reason(1.5, 1.0) != ""


def test_a_checked_scan_is_a_copy_of_the_finite_rays():
    ends = [[1.0, 0.0, 0.0], [float("nan"), 0.0, 0.0]]
    scan = RangeScan.of_points("lidar", ends, (0.0, 0.0, 1.0), 2.0)
    checked = scan.checked()
    scan.ends[0, 0] = 5.0
    assert checked.ends.tolist() == [[1.0, 0.0, 0.0]] and checked.hits.tolist() == [True]
    with pytest.raises(ValueError, match="2 ray ends but 1 hit flags"):
        RangeScan("lidar", "map", (0.0, 0.0, 0.0), ends, [True], 1.0).checked()
    with pytest.raises(ValueError, match="origin and stamp of a scan must be finite"):
        RangeScan("lidar", "map", (float("inf"), 0.0, 0.0), ends, [True, True], 1.0).checked()


@pytest.mark.parametrize("far", [1e300, -2e9])
def test_rays_that_end_beyond_the_bound_of_coordinates_are_left_out_and_an_origin_there_is_refused(far):
    scan = RangeScan.of_points("lidar", [[1.0, 0.0, 0.0], [0.0, far, 0.0]], (0.0, 0.0, 1.0), 2.0).checked()

    assert scan.ends.tolist() == [[1.0, 0.0, 0.0]] and scan.hits.tolist() == [True]
    with pytest.raises(ValueError, match=r"origin of a scan must be within 1e\+09 m of zero"):
        RangeScan.of_points("lidar", [[1.0, 0.0, 0.0]], (0.0, far, 0.0), 2.0).checked()
