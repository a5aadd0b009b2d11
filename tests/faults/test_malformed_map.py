"""Fault table, rows 22 and 30: malformed and hostile maps: descriptions, images, a server that is asked to use one."""

from pathlib import Path

import numpy as np
import pytest
import yaml
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from PIL import Image

from mbf_abstract.geometry import Pose
from mbf_abstract.geometry.transform_buffer import TransformBuffer
from mbf_abstract.navigator import Navigator
from mbf_abstract.testing.loopback import LoopbackRobot
from mbf_abstract.time.sim_clock import SimClock
from mbf_costmap_nav.files.map_description import MapError, read_description
from mbf_costmap_nav.files.map_io import load_image, load_map
from mbf_costmap_nav.grid.zones import load_zones
from mbf_costmap_nav.map.costmap_config import CostmapParameters, build_layered_costmap

GOOD = {"image": "map.pgm", "resolution": 0.05, "origin": [0.0, 0.0, 0.0]}
BAD_DESCRIPTIONS = {
    "no image": ({"image": None}, "image"),
    "zero resolution": ({"resolution": 0.0}, "resolution"),
    "tiny resolution": ({"resolution": 1e-300}, "resolution"),
    "infinite resolution": ({"resolution": float("inf")}, "resolution"),
    "origin of two": ({"origin": [0.0, 0.0]}, "origin"),
    "origin with nan": ({"origin": [0.0, float("nan"), 0.0]}, "origin"),
    "origin far away": ({"origin": [1e200, 0.0, 0.0]}, r"origin\[0\]: .*<= 1e.09, got 1e.200"),
    "unknown mode": ({"mode": "binary"}, "mode"),
    "thresholds swapped": ({"occupied_thresh": 0.1, "free_thresh": 0.9}, "free_thresh"),
    "threshold too large": ({"occupied_thresh": 65}, "occupied_thresh"),
}


@pytest.mark.parametrize("case", BAD_DESCRIPTIONS)
def test_a_bad_description_is_refused_with_the_key(tmp_path, case):
    change, key = BAD_DESCRIPTIONS[case]
    (tmp_path / "map.yaml").write_text(yaml.safe_dump(GOOD | change))
    with pytest.raises(MapError, match=key) as caught:
        load_map(tmp_path / "map.yaml")
    assert caught.value.file == tmp_path / "map.yaml"


@pytest.mark.parametrize("text", ["", "just text", "[1, 2]", "image: [", "\x00", "a: !!python/object:os.system 1"])
def test_a_file_that_is_no_mapping_is_refused(tmp_path, text):
    (tmp_path / "map.yaml").write_text(text)
    with pytest.raises(MapError):
        load_map(tmp_path / "map.yaml")


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("origin: [0, 0, 0]", "resolution: expected a value >= 0.0001 and <= 1000 m, got nothing"),
        ("resolution: x", "resolution: expected a number >= 0.0001 and <= 1000 m, got 'x'"),
        ("negate: maybe", "negate: expected true or false, got 'maybe'"),
    ],
)
def test_a_wrong_key_is_named_with_what_was_expected(tmp_path, text, reason):
    (tmp_path / "map.yaml").write_text(f"image: map.pgm\n{text}\n")
    with pytest.raises(MapError) as caught:
        load_map(tmp_path / "map.yaml")
    assert reason in str(caught.value)
    assert reason in "\n".join(finding.text for finding in caught.value.findings)


NASTY = {
    "a date with month 99": ("foo: 2001-99-99", "line 4: foo: expected a plain value"),
    "a number of 5000 digits": ("foo: " + "9" * 5000, "line 4: foo"),
    "a number of 5000 hexadecimal digits": ("negate: 0x" + "f" * 5000, "line 4: negate"),
    "deep nesting": ("foo: " + "[" * 5000 + "]" * 5000, "levels of nesting"),
    "an alias bomb": ("a: &a [x, x]\n" + "".join(f"b{i}: [{'*a, ' * 50}]\n" for i in range(5)), "100 aliases"),
    "a key twice": ("resolution: 0.2", "line 4: resolution: expected each key once"),
    "a long value": ("mode: " + "x" * 100_000, "line 4: mode: expected 'trinary', 'scale' or 'raw', got 'xxx"),
    "a long key twice": ("\n".join(["? " + "k" * 50_000 + "\n: 1"] * 2), "line 6: kkk"),
    "a python object": ("foo: !!python/object/apply:os.system [ls]", "the YAML tag"),
}


@pytest.mark.parametrize("confined", [False, True])
@pytest.mark.parametrize("case", NASTY)
def test_a_nasty_description_is_refused_with_its_line_in_a_short_message(tmp_path, case, confined):
    text, says = NASTY[case]
    (tmp_path / "map.yaml").write_text("image: map.pgm\nresolution: 0.05\norigin: [0, 0, 0]\n" + text)
    with pytest.raises(MapError) as caught:
        load_map(tmp_path / "map.yaml", confined=confined)
    assert says in str(caught.value) and len(str(caught.value)) < 1000


@pytest.mark.parametrize("image", ['"a\\0.pgm"', "a" * 5000 + ".pgm"])
@pytest.mark.parametrize("confined", [False, True])
def test_an_image_whose_name_is_no_file_name_is_refused(tmp_path, image, confined):
    (tmp_path / "map.yaml").write_text(f"image: {image}\nresolution: 0.05\norigin: [0, 0, 0]\n")
    with pytest.raises(MapError):
        load_map(tmp_path / "map.yaml", confined=confined)


@pytest.mark.parametrize("text", [*(text for text, _ in NASTY.values()), "zones: [" + "{}, " * 9000 + "]"])
def test_a_nasty_zones_file_is_refused_in_a_short_message(tmp_path, text):
    (tmp_path / "zones.yaml").write_text(text)
    with pytest.raises(MapError, match=r"zones\.yaml: line \d+: ") as caught:
        load_zones(tmp_path / "zones.yaml")
    assert len(str(caught.value)) < 2000


def test_a_file_whose_name_holds_a_null_character_is_refused():
    for load in (load_map, load_zones):
        with pytest.raises(MapError):
            load(Path("map\0.yaml"))


BAD_IMAGES = {
    "empty": b"",
    "no image": b"hello",
    "bad header": b"P5\nten 10\n255\n" + bytes(100),
    "short data": b"P5\n10 10\n255\n" + bytes(50),
    "no pixels": b"P5\n0 10\n255\n",
    "sixteen bit": b"P5\n2 2\n65535\n" + bytes(8),
    "absurd size": b"P5\n100000 100000\n255\n",
    "too many cells": b"P5\n9000 9000\n255\n",
}


@pytest.mark.parametrize("case", BAD_IMAGES)
def test_a_bad_image_is_refused_before_memory_is_taken(tmp_path, case):
    (tmp_path / "map.pgm").write_bytes(BAD_IMAGES[case])
    (tmp_path / "map.yaml").write_text(yaml.safe_dump(GOOD))
    with pytest.raises(MapError) as caught:
        load_map(tmp_path / "map.yaml")
    assert caught.value.file == tmp_path / "map.pgm" and caught.value.reason


@given(st.binary(max_size=200), st.sampled_from([b"", b"P5\n", b"P5\n4 4\n255\n", b"\x89PNG\r\n\x1a\n", b"BM"]))
@settings(max_examples=40, suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
def test_any_bytes_are_a_map_or_a_map_error(tmp_path, content, start):
    file = tmp_path / "map.pgm"
    file.write_bytes(start + content)
    try:
        assert load_image(file, 1.0).occupancy.size > 0
    except MapError as error:
        assert error.file == file and error.reason


@given(
    st.text(max_size=80)
    | st.dictionaries(st.sampled_from([*GOOD, "mode"]), st.none() | st.floats() | st.text()).map(yaml.safe_dump)
)
@settings(max_examples=40, suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
def test_any_text_is_a_description_or_a_map_error(tmp_path, text):
    file = tmp_path / "map.yaml"
    file.write_text(text, encoding="utf-8")
    try:
        assert read_description(file).resolution > 0.0
    except MapError as error:
        assert error.file == file and error.reason


@pytest.mark.parametrize("layer", ["static", "keepout", "speed_limit"])
@pytest.mark.parametrize("image", ["../secret.pgm", "link.pgm", "{folder}/secret.pgm"])
def test_an_image_out_of_the_maps_folder_is_refused_where_that_is_asked_for(tmp_path, layer, image):
    (tmp_path / "maps").mkdir()
    Image.fromarray(np.full((4, 4), 255, np.uint8)).save(tmp_path / "secret.pgm")
    (tmp_path / "maps" / "link.pgm").symlink_to(tmp_path / "secret.pgm")
    description = GOOD | {"image": image.format(folder=tmp_path)}
    (tmp_path / "maps" / "map.yaml").write_text(yaml.safe_dump(description))
    key = "map_file" if layer == "static" else "mask_file"

    def build(**parameters):
        chosen = CostmapParameters(layers=({"name": "it", "type": layer},), **parameters)
        return build_layered_costmap(chosen, {"it": {key: "maps/map.yaml"}}, base_folder=tmp_path)

    build()
    with pytest.raises(MapError, match="expected a file in the folder of the map"):
        build(confine_images=True)


CONFIG = """
backend: costmap
planners: [{name: planner, type: astar}]
global_costmap: {layers: [{name: walls, type: static}], walls: {map_file: map.yaml}}
local_costmap: {rolling_window: true, width: 2.0, height: 2.0, layers: [{name: area, type: keepout}], area: {zones: []}}
"""


def test_a_server_refuses_a_malformed_map_before_it_starts_and_starts_with_the_repaired_one(tmp_path):
    (tmp_path / "robot.yaml").write_text(CONFIG)
    (tmp_path / "map.yaml").write_text(yaml.safe_dump(GOOD))
    (tmp_path / "map.pgm").write_bytes(BAD_IMAGES["short data"])
    clock, transforms = SimClock(), TransformBuffer()
    robot = LoopbackRobot(clock, transforms, Pose.planar(0.5, 0.5))
    with pytest.raises(MapError, match=r"map\.pgm"):
        Navigator.from_file(tmp_path / "robot.yaml", robot, clock, transforms)
    clock.sleep(0.1)
    assert set(clock.thread_names) == {"main", "loopback robot"}, "no thread of the server is left"

    Image.fromarray(np.full((40, 40), 255, np.uint8)).save(tmp_path / "map.pgm")
    with Navigator.from_file(tmp_path / "robot.yaml", robot, clock, transforms) as navigator:
        clock.sleep(0.5)
        assert navigator.get_path(Pose.planar(1.5, 1.5)).success
    robot.close()
