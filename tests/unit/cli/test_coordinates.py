"""``--start X Y [Z] [YAW]``: how many numbers, negative ones, and what is refused."""

import pytest
import typer
from hypothesis import given
from hypothesis import strategies as st

from mbf_abstract.commands.coordinates import Place, join_numbers, parse_place

NUMBERS = st.lists(st.floats(-1e9, 1e9, width=32), min_size=2, max_size=4)


def test_negative_numbers_belong_to_the_option_before_them():
    joined = join_numbers(["map.yaml", "--start", "-1.5", "2", "--goal", "3", "-4e-1", "0", "--json"])

    assert joined == ["map.yaml", "--start=-1.5,2", "--goal=3,-4e-1,0", "--json"]


def test_numbers_with_commas_between_them_belong_to_the_option_too():
    assert join_numbers(["--start", "-1,2", "--goal", "3,4", "0.5", "a,b"]) == ["--start=-1,2", "--goal=3,4,0.5", "a,b"]


def test_an_equals_sign_may_stand_before_the_first_number():
    assert join_numbers(["--start=-1", "2", "map.yaml"]) == ["--start=-1,2", "map.yaml"]


def test_numbers_of_other_options_are_left_alone():
    arguments = ["--tolerance", "0.5", "--planner", "astar"]

    assert join_numbers(arguments) == arguments


@given(start=NUMBERS, goal=NUMBERS)
def test_what_is_joined_is_parsed_to_the_same_numbers(start, goal):
    joined = join_numbers(["--start", *map(repr, start), "--goal", *map(repr, goal), "map.yaml"])

    for numbers, text in zip((start, goal), joined[:2], strict=True):
        place = parse_place(text.partition("=")[2], "--start")
        assert place == Place(*numbers)


@pytest.mark.parametrize("text", ["", "1", "1,2,3,4,5", "1,two", "nan,1", "1,inf", "1,1e200"])
def test_too_few_too_many_or_no_numbers_and_absurd_ones_are_refused(text):
    with pytest.raises(typer.BadParameter):
        parse_place(text, "--start")


def test_two_numbers_leave_the_height_to_the_ground():
    assert parse_place("1,2", "--start") == Place(1.0, 2.0, None, None)
    assert parse_place("1,2,3,0.5", "--start") == Place(1.0, 2.0, 3.0, 0.5)


@pytest.mark.parametrize(
    ("text", "place"),
    [
        ("1,2", Place(1.0, 2.0, None, None)),
        ("1,2,0.5", Place(1.0, 2.0, None, 0.5)),
        ("1,2,3,0.5", Place(1.0, 2.0, 3.0, 0.5)),
    ],
)
def test_on_a_flat_map_the_third_of_three_numbers_is_the_yaw(text, place):
    assert parse_place(text, "--start").on_flat_map() == place
