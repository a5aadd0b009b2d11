"""Runs the notebooks and keeps their outputs: ``python docs/run_notebooks.py [--check]``.

Outputs are committed so that the pages show pictures without being run; ``--check`` runs the notebooks too, keeps
nothing, and fails where a printed line is not the committed one: the same words, and numbers within some percent, so
that a planner may become better. Pictures are not compared.
"""

from __future__ import annotations

import base64
import io
import math
import re
import sys
from pathlib import Path

import nbformat
from nbclient import NotebookClient
from PIL import Image

NOTEBOOKS = Path(__file__).resolve().parent / "notebooks"
COLOURS = 64
NUMBER = re.compile(r"\d+(?:\.\d+)?")
TOLERANCE = 0.1
TIMEOUT = 300  # s a cell may take; kernels may have to be compiled


def run(notebook: nbformat.NotebookNode) -> nbformat.NotebookNode:
    """Run all cells in a new kernel of this very Python; raises CellExecutionError where one fails."""
    fresh = nbformat.from_dict(notebook)
    NotebookClient(fresh, timeout=TIMEOUT, resources={"metadata": {"path": str(NOTEBOOKS)}}).execute()
    fresh.metadata = {"kernelspec": {"name": "python3", "display_name": "Python 3", "language": "python"}}
    for number, cell in enumerate(fresh.cells):
        cell.id, cell.metadata = f"cell-{number}", {}
        for output in cell.get("outputs", []):
            if "image/png" in output.get("data", {}):
                output.data["image/png"] = _small(output.data["image/png"])
    return fresh


def _small(png: str) -> str:
    """The same picture in 64 colours, a third of the size."""
    picture, small = Image.open(io.BytesIO(base64.b64decode(png))).convert("RGB"), io.BytesIO()
    picture.quantize(COLOURS).save(small, "PNG", optimize=True)
    return base64.b64encode(small.getvalue()).decode("ascii")


def printed(notebook: nbformat.NotebookNode) -> list[str]:
    """Every line that the cells print, with the number of its cell."""
    return [
        f"cell {number}: {line}"
        for number, cell in enumerate(notebook.cells)
        for output in cell.get("outputs", [])
        if output.output_type == "stream"
        for line in output.text.splitlines()
    ]


def alike(left: list[str], right: list[str]) -> bool:
    """Whether lines have the same words, and numbers that differ by ``TOLERANCE`` at most."""
    if NUMBER.sub("#", "\n".join(left)) != NUMBER.sub("#", "\n".join(right)):
        return False
    pairs = zip(*(map(float, NUMBER.findall("\n".join(lines))) for lines in (left, right)), strict=True)
    return all(math.isclose(one, other, rel_tol=TOLERANCE) for one, other in pairs)


def main(check: bool) -> int:
    """Run all notebooks; return the number of those whose printed lines have changed."""
    changed = 0
    for file in sorted(NOTEBOOKS.glob("*.ipynb")):
        committed = nbformat.read(file, as_version=4)
        fresh = run(committed)
        if not alike(printed(fresh), printed(committed)):
            changed += 1
            sys.stdout.write("\n".join([f"changed: {file.name}", *printed(fresh), ""]))
        if not check:
            nbformat.write(fresh, file)
    return changed if check else 0


if __name__ == "__main__":
    sys.exit(main("--check" in sys.argv[1:]))
