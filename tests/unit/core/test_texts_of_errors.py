"""What a command prints of an error: one line that says which file or parameter is wrong, and why."""

import pytest
from pydantic import ValidationError

from mbf_abstract.config.findings import text_of
from mbf_abstract.config.navigation_parameters import NavigationParameters


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
