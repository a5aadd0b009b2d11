"""``mbf robot show``: table, JSON, picture, and one line for each mistake."""

import json

import pytest
from PIL import Image
from typer.testing import CliRunner

from mbf_abstract.cli import make_app
from tests.unit.robots.conftest import KIWI, SHIPPED


def mbf(*arguments):
    return CliRunner().invoke(make_app(), ["robot", "show", *map(str, arguments)])


def test_the_table_names_drive_wheels_and_placeholders():
    shown = mbf(SHIPPED / "husky.urdf")
    assert shown.exit_code == 0
    for text in ("skid", "front_left", "tips over at", "52 deg", "$ROBOT_TRACK", "0.5708", "note: max_speed"):
        assert text in shown.output, shown.output


def test_json_holds_the_same_numbers_and_what_is_set():
    shown = json.loads(mbf(SHIPPED / "husky.urdf", "--json", "--set", "max_speed=0.5").output)
    assert (shown["drive"], shown["track"], shown["max_speed"]) == ("skid", 0.5708, 0.5)
    assert shown["navigation"]["$ROBOT_MAX_SPEED"] == "0.5"
    assert shown["tips_over_at"]["forward"] == pytest.approx(0.9018, abs=1e-4)


def test_the_picture_is_an_image(tmp_path):
    assert mbf(KIWI, "--png", tmp_path / "kiwi.png").exit_code == 0
    with Image.open(tmp_path / "kiwi.png") as image:
        assert min(image.size) > 300


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (["nothing.urdf"], "urdf: expected a file"),
        ([SHIPPED / "husky.urdf", "--set", "max_sped=1"], "did you mean 'max_speed'?"),
        ([SHIPPED / "husky.urdf", "--set", "max_speed"], "expected KEY=VALUE"),
        ([SHIPPED / "husky.urdf", "--set", "drive=ackermann"], "expected one steered wheel"),
        ([SHIPPED / "husky.urdf", "--set", "footprint=[[0, 0], [0, 1], [1, 0]]"], "counter-clockwise"),
        ([SHIPPED / "husky.urdf", "--set", "footprint_heights=[1, 0.5]"], "the lower height first"),
    ],
)
def test_a_mistake_is_one_line_and_exit_code_2(arguments, expected):
    shown = mbf(*arguments)
    assert shown.exit_code == 2
    assert expected in shown.output
