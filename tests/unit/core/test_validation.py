from enum import Enum
from pathlib import Path
from typing import Literal

import pytest
from pydantic import FilePath, create_model, model_validator

from mbf_abstract.config.validation import validate
from mbf_abstract.config.yaml_source import YamlDocument
from mbf_abstract.parameters import ParameterModel, parameter


class Side(Enum):
    LEFT = "left"


class Inner(ParameterModel):
    count: int = parameter(3, "Count.", ge=1)
    image: Path | None = None


class Model(ParameterModel):
    speed: float = parameter(1.0, "Speed.", unit="m/s", gt=0, le=5)
    count: int = parameter(1, "Count.", ge=0)
    corner: tuple[float, float] = parameter((1.0, 2.0), "Corner.", unit="m")
    mode: Literal["a", "b"] = "a"
    side: Side = Side.LEFT
    image: FilePath | None = None
    inner: Inner = Inner()
    items: tuple[Inner, ...] = ()
    limit: float | None = parameter(None, "Limit.", unit="rad", gt=0)
    range: float = parameter(1.0, "Range.", allow_inf=True)
    id: int | str = 3
    enabled: bool = True

    @model_validator(mode="after")
    def _count_and_speed(self):
        if self.count > 100 and self.speed > 4:
            raise ValueError("a count up to 100 at this speed")
        return self


class Required(ParameterModel):
    width: float = parameter(..., "Width.", unit="m", gt=0)


class Alternatives(ParameterModel):
    part: Inner | int = 1


DOCUMENT = YamlDocument(Path("/folder/c.yaml"), {}, {("block",): 4, ("block", "speed"): 5, ("block", "items", 1): 9})


def check(data, model=Model, document=DOCUMENT):
    findings = []
    instance = validate(model, data, document, ("block",), findings)
    assert (instance is None) == bool(findings)
    return instance, findings


def test_a_legal_block_becomes_a_model():
    instance, _ = check({"speed": 2, "corner": [1, 2.5], "side": "left", "range": float("inf"), "items": [{}]})
    assert instance == Model(speed=2.0, corner=(1.0, 2.5), range=float("inf"), items=(Inner(),))


def test_an_absent_block_means_the_defaults():
    assert check(None)[0] == Model()


@pytest.mark.parametrize(
    ("key", "value", "expected"),
    [
        ("speed", 0, "expected a number > 0 and <= 5 m/s, got 0"),
        ("speed", "fast", "expected a number > 0 and <= 5 m/s, got 'fast'"),
        ("speed", True, "expected a number > 0 and <= 5 m/s, got True"),
        ("speed", "2", "expected a number > 0 and <= 5 m/s, got '2'"),
        ("speed", None, "expected a number > 0 and <= 5 m/s, got nothing"),
        ("speed", float("nan"), "expected a finite number > 0 and <= 5 m/s, got nan"),
        ("speed", {"a": 1}, "expected a number > 0 and <= 5 m/s, got a block of 1 keys"),
        ("count", -1, "expected a whole number >= 0, got -1"),
        ("count", 2.0, "expected a whole number >= 0, got 2.0"),
        ("corner", [1, 2, 3], "expected a list of 2 items, got a list of 3 items"),
        ("corner", 3, "expected a list, got 3"),
        ("mode", "c", "expected 'a' or 'b', got 'c'"),
        ("side", "right", "expected 'left', got 'right'"),
        ("limit", -1, "expected a number > 0 rad, got -1"),
        ("inner", 3, "expected a block of keys, got 3"),
        ("inner", [3], "expected a block of keys, got a list of 1 items"),
        ("id", 1.5, "expected a whole number or a text, got 1.5"),
        ("enabled", "maybe", "expected true or false, got 'maybe'"),
        ("image", "no.png", "expected a file that exists, got '/folder/no.png'"),
        ("sped", 1, "expected a known key, got 'sped' (did you mean 'speed'?)"),
    ],
)
def test_a_wrong_value_names_key_expectation_and_value(key, value, expected):
    _, findings = check({key: value})
    assert len(findings) == 1
    assert f"block.{key}" in findings[0].text
    assert expected in findings[0].text


def test_nested_keys_are_named_with_their_line():
    _, findings = check({"items": [{}, {"count": 0, "cont": 1}], "inner": {"zzz": 1}, "speed": 9})
    assert [finding.text for finding in findings] == [
        "/folder/c.yaml:5: block.speed: expected a number > 0 and <= 5 m/s, got 9",
        "/folder/c.yaml:4: block.inner.zzz: expected a known key, got 'zzz' (known keys: count, image)",
        "/folder/c.yaml:9: block.items[1].count: expected a whole number >= 1, got 0",
        "/folder/c.yaml:9: block.items[1].cont: expected a known key, got 'cont' (did you mean 'count'?)",
    ]


def test_a_bad_item_of_a_list_is_described_by_its_field():
    _, findings = check({"corner": [1, "x"]})
    assert findings[0].text == "/folder/c.yaml:4: block.corner[1]: expected a number in m, got 'x'"


def test_a_missing_value_is_a_finding_at_the_block():
    _, findings = check({}, Required)
    assert findings[0].text == "/folder/c.yaml:4: block.width: expected a value > 0 m, got nothing"


def test_a_rule_between_fields_is_a_finding_of_the_block():
    _, findings = check({"count": 200, "speed": 5})
    assert findings[0].text.startswith("/folder/c.yaml:4: block: expected a count up to 100 at this speed")


@pytest.mark.parametrize("data", [[1], 3, "text", [], 0, "", False])
def test_a_block_that_is_no_mapping_is_refused(data):
    _, findings = check(data)
    assert "block: expected a block of keys, got" in findings[0].text


def test_what_is_wrong_inside_one_alternative_goes_before_that_the_whole_is_no_other_one():
    _, findings = check({"part": {"count": 0}}, Alternatives)
    assert [finding.key for finding in findings] == ["block.part.count"]
    _, findings = check({"part": "many"}, Alternatives)
    assert [(finding.key, finding.expected) for finding in findings] == [
        ("block.part", "a block of keys or a whole number")
    ]


@pytest.mark.parametrize(("count", "more"), [(15, ""), (16, ", ...")])
def test_a_key_like_no_other_is_answered_by_the_first_15_known_ones(count, more):
    model = create_model("Many", __base__=ParameterModel, **{f"name_{i:02}": (int, 0) for i in range(count)})
    _, findings = check({"zzz": 1}, model)
    assert findings[0].hint == "known keys: " + ", ".join(f"name_{i:02}" for i in range(15)) + more


def test_relative_paths_count_from_the_folder_of_the_file(tmp_path):
    (tmp_path / "map.png").write_bytes(b"")
    document = YamlDocument(tmp_path / "c.yaml", {})
    data = {"image": "map.png", "inner": {"image": "sub/x.png"}, "items": [{"image": "/absolute.png"}, {}]}
    instance, _ = check(data, document=document)
    assert instance.image == tmp_path / "map.png"
    assert instance.inner.image == tmp_path / "sub" / "x.png"
    assert instance.items[0].image == Path("/absolute.png")
    assert data["image"] == "map.png"
