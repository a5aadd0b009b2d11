"""Every Python block of README and pages can be read by Python, and what it imports from here exists."""

import ast
import importlib
import re
import textwrap
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").glob("*.md"))]
OURS = ("mbf_abstract", "mbf_costmap_nav", "mbf_mesh_nav", "mbf_ros", "terrain")


def blocks_of(page):
    found = re.finditer(r"^( *)```python\n(.*?)^ *```", page.read_text("utf-8"), re.DOTALL | re.MULTILINE)
    return [(page.read_text("utf-8")[: one.start()].count("\n") + 1, textwrap.dedent(one.group(2))) for one in found]


def imports_in(tree):
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and node.module:
            yield from ((node.module, alias.name) for alias in node.names)
        elif isinstance(node, ast.Import):
            yield from ((alias.name, "") for alias in node.names)


@pytest.mark.parametrize("page", [page for page in PAGES if blocks_of(page)], ids=lambda page: page.stem)
def test_the_python_blocks_of_a_page_are_python_and_import_what_there_is(page):
    wrong = []
    for line, block in blocks_of(page):
        for module, name in imports_in(ast.parse(block, f"{page.name}:{line}")):
            if module.split(".")[0] in OURS:
                there = importlib.import_module(module)
                if name and not hasattr(there, name):
                    wrong.append(f"{page.name}:{line}: {module} has no {name}")
    assert not wrong


def test_blocks_are_found():
    assert sum(len(blocks_of(page)) for page in PAGES) > 40
