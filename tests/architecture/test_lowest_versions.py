"""Every requirement names a lowest version, which CI installs and tests; pyproject.toml gives the constraints."""

import importlib.util
from pathlib import Path

import pytest

pytest.importorskip("tomllib", reason="CI makes the constraints with Python 3.11 or newer")

REPOSITORY = Path(__file__).resolve().parents[2]
SPEC = importlib.util.spec_from_file_location("lowest_versions", REPOSITORY / ".ci" / "lowest_versions.py")
assert SPEC is not None and SPEC.loader is not None
MODULE = importlib.util.module_from_spec(SPEC)
SPEC.loader.exec_module(MODULE)

PROJECT = """
[project]
dependencies = ["numpy>=1.26.4", "pyyaml>=6.0.1"]
[project.optional-dependencies]
sim = ["viser>=1.1", "rerun-sdk>=0.41; python_version >= '3.11'"]
test = ["example[sim]", {}]
"""


def test_every_requirement_of_ours_has_a_lowest_version():
    lowest = MODULE.lowest_versions((REPOSITORY / "pyproject.toml").read_text("utf-8"))
    assert {"numpy", "pybullet", "pytest", "ruff"} <= lowest.keys()


def test_markers_are_kept_and_own_extras_followed():
    lowest = MODULE.lowest_versions(PROJECT.replace("example", "mbf-flex").format('"numpy>=1.26.4"'))
    assert lowest == {
        "numpy": "1.26.4",
        "pyyaml": "6.0.1",
        "viser": "1.1",
        "rerun-sdk": "0.41; python_version >= '3.11'",
    }


@pytest.mark.parametrize(
    ("requirement", "text"),
    [
        ("scipy", "expected 'name>=version', got 'scipy'"),
        ("scipy==1.15.0", "expected 'name>=version'"),
        ("scipy>=1.15,<2", "expected 'name>=version'"),
        ("numpy>=2.0", "'numpy' has the bounds 1.26.4 and 2.0"),
    ],
)
def test_a_requirement_without_one_lowest_version_is_refused(requirement, text):
    with pytest.raises(ValueError, match=text):
        MODULE.lowest_versions(PROJECT.replace("example", "mbf-flex").format(f'"{requirement}"'))
