"""The files that a configuration names: those that are missing, with their lines."""

from types import SimpleNamespace

import pytest

from mbf_abstract.config.findings import ConfigError
from mbf_abstract.config.implausible import implausible_values
from mbf_abstract.config.named_files import refuse_missing_files
from mbf_abstract.parameters import ParameterModel, parameter

TEXT = """\
local_map:
  frame_id: map
  mesh_file: {mesh}
  walls: {{mask_file: {mask}}}
"""


class Named(ParameterModel):
    """A block that names a file."""

    frame_id: str = parameter("map", "Not a file.")
    mesh_file: str = parameter("", "A file.", reads_file=True)
    mask_file: str = parameter("", "Another one.", reads_file=True)
    robot_radius: float = parameter(0.0, "Radius.", unit="m")
    max_vel_theta: float = parameter(0.0, "Yaw rate.", unit="rad/s")


@pytest.fixture
def config_of(tmp_path):
    """``config_of(mesh, mask)``: a configuration whose map names a mesh, and whose layer a mask."""

    def make(mesh="", mask=""):
        path = tmp_path / "navigation.yaml"
        path.write_text(TEXT.format(mesh=mesh or '""', mask=mask or '""'))
        walls = SimpleNamespace(name="walls", parameters=Named(mask_file=mask))
        section = SimpleNamespace(parameters=Named(mesh_file=mesh), layers=[walls])
        return SimpleNamespace(path=path, sections={"local_map": section})

    return make


def test_every_file_that_is_missing_is_named_with_its_line(config_of):
    with pytest.raises(ConfigError) as refused:
        refuse_missing_files(config_of("ground.ply", "doors.png"))
    places = [(finding.line, finding.key) for finding in refused.value.findings]
    assert places == [(3, "local_map.mesh_file"), (4, "local_map.walls.mask_file")]
    assert "'ground.ply', which is not there" in str(refused.value)


def test_files_that_are_there_or_not_named_are_no_findings(config_of, tmp_path):
    (tmp_path / "ground.ply").touch()
    refuse_missing_files(config_of("ground.ply"))
    (tmp_path / "ground.ply").unlink()
    with pytest.raises(ConfigError):
        refuse_missing_files(config_of("ground.ply"))


def test_a_name_that_no_file_can_have_is_a_finding_too(config_of):
    with pytest.raises(ConfigError, match="which is not there"):
        refuse_missing_files(config_of("x" * 300))


@pytest.mark.parametrize(
    ("values", "meant"),
    [({"max_vel_theta": 45.0}, "radians"), ({"robot_radius": 300.0}, "metres"), ({"max_vel_theta": 3.0}, "")],
)
def test_numbers_in_another_unit_are_noted(values, meant):
    found = list(implausible_values(Named(**values), "robot: "))
    assert [text.startswith("robot: ") and meant in text for text in found] == [True] * bool(meant)
