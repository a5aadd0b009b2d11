"""The example modules are imported by name, as a configuration does; the generator is a script beside the docs."""

import sys
from pathlib import Path

import pytest

REPOSITORY = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="session", autouse=True)
def example_modules():
    """Put the folders of the examples and of the generator on the Python path."""
    folders = [str(REPOSITORY / folder) for folder in ("examples/plugins", "examples/backends", "docs")]
    sys.path[:0] = folders
    yield
    for folder in folders:
        sys.path.remove(folder)
