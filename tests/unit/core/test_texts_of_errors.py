"""What a command prints of an error: one line that says which file or parameter is wrong, and why."""

import pytest
from pydantic import ValidationError

from mbf_abstract.config.findings import text_of
from mbf_abstract.config.navigation_parameters import NavigationParameters
from mbf_abstract.parameters import ParameterError, ParameterModel, parameter, with_changes


def test_an_error_of_a_file_names_the_file_and_the_reason_without_a_number(tmp_path):
    with pytest.raises(FileNotFoundError) as caught:
        (tmp_path / "robot.yaml").open()
    assert text_of(caught.value) == f"{tmp_path / 'robot.yaml'}: No such file or directory"


def test_wrong_parameters_have_a_line_each_with_what_came():
    with pytest.raises(ValidationError) as caught:
        NavigationParameters(controller_frequency=-1.0, planner_patience="soon")
    first, second = sorted(text_of(caught.value).splitlines())
    assert first.startswith("controller_frequency: ") and first.endswith("got -1.0")
    assert second.startswith("planner_patience: ") and second.endswith("got 'soon'")


def test_an_error_without_a_text_has_its_name():
    assert text_of(RuntimeError()) == "RuntimeError"


class Source(ParameterModel):
    max_range: float = parameter(5.0, "How far it sees.", unit="m", gt=0.0)


class Sources(ParameterModel):
    sources: dict[str, Source] = parameter({}, "By their names.")
    delay: float = parameter(0.0, "Of all of them.", unit="s")


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        ({"sources": {"lidar": {"max_range": -1.0}}}, "map.sources.lidar.max_range: expected a number > 0 m, got -1.0"),
        ({"sources": {"lidar": {"max": 1.0}}}, "map.sources.lidar.max: expected a known key, got 'max' (known keys: m"),
        ({"delay": "long"}, "map.delay: expected a number in s, got 'long'"),
    ],
)
def test_a_wrong_change_names_the_key_the_range_and_what_came(changes, text):
    with pytest.raises(ParameterError) as caught:
        with_changes(Sources(), changes, where=("map",))
    assert str(caught.value).startswith(text)
