"""The notebooks of the documentation run from top to bottom and print what is committed."""

import importlib
from pathlib import Path

import nbformat
import pytest

NOTEBOOKS = sorted((Path(__file__).resolve().parents[2] / "docs" / "notebooks").glob("*.ipynb"))

pytestmark = [
    pytest.mark.timeout(300),
    pytest.mark.filterwarnings("default"),  # of the notebook machinery and its event loop, none of ours
]


@pytest.mark.parametrize("file", NOTEBOOKS, ids=[file.stem for file in NOTEBOOKS])
def test_a_notebook_runs_and_prints_what_is_committed(file):
    script = importlib.import_module("run_notebooks")
    committed = nbformat.read(file, as_version=4)

    lines = script.printed(script.run(committed))

    assert script.alike(lines, script.printed(committed)), lines
    assert len(lines) > 3


def test_notebooks_are_small_and_were_run_from_top_to_bottom():
    assert len(NOTEBOOKS) >= 2
    for file in NOTEBOOKS:
        counts = [cell.execution_count for cell in nbformat.read(file, as_version=4).cells if cell.cell_type == "code"]
        assert counts == list(range(1, len(counts) + 1))
        assert file.stat().st_size < 600_000


@pytest.mark.parametrize(
    ("line", "alike"),
    [
        ("cell 6: astar SUCCESS: 32.1 m", True),
        ("cell 6: astar SUCCESS: 33 m", True),
        ("cell 6: astar SUCCESS: 45.1 m", False),
        ("cell 6: astar CANCELED: 32.1 m", False),
        ("cell 6: astar SUCCESS", False),
    ],
)
def test_lines_are_alike_if_words_are_the_same_and_numbers_nearly(line, alike):
    assert importlib.import_module("run_notebooks").alike([line], ["cell 6: astar SUCCESS: 32.1 m"]) is alike
