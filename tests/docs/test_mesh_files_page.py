"""The page on mesh files names every format, every repair and every finding there is."""

import re
from pathlib import Path

from mbf_mesh_nav.files.mesh_io import SPLIT_CORNERS, known_endings
from mbf_mesh_nav.map import map_builder, map_findings
from mbf_mesh_nav.mesh import repair
from mbf_mesh_nav.mesh.repair import REPAIRS

PAGE = (Path(__file__).resolve().parents[2] / "docs" / "mesh_files.md").read_text("utf-8")


def first_column(title: str) -> list[str]:
    """Names in the first column of the table below a heading."""
    table = PAGE.split(f"## {title}\n")[1].split("\n## ")[0]
    cells = [row.split("|")[1] for row in re.findall(r"^\|.*\|$", table, re.MULTILINE)[2:]]
    return [name for cell in cells for name in re.findall(r"`([^`]+)`", cell)]


def test_the_formats_of_the_page_are_those_that_can_be_read():
    assert set(first_column("Formats")) == known_endings()


def test_the_formats_that_are_joined_are_marked_so():
    joined = next(row for row in PAGE.splitlines() if "joined when read" in row)
    assert set(re.findall(r"`(\.\w+)`", joined)) == SPLIT_CORNERS


def test_every_repair_and_every_finding_of_the_checks_is_on_the_page():
    sources = "".join(Path(module.__file__).read_text("utf-8") for module in (repair, map_builder, map_findings))
    found = set(re.findall(r'(?:self\.found|Finding)\("(\w+)"', sources)) - {"components"}
    assert set(first_column("Findings and repairs")) == found | set(REPAIRS)
