"""Fixtures that every test may use."""

import os
from pathlib import Path

import pytest

REPOSITORY = Path(__file__).resolve().parent.parent


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """Folder of the real maps, meshes and terrains: $MBF_DATA, or ../shared/data beside the clone."""
    folder = Path(os.environ.get("MBF_DATA", REPOSITORY.parent / "shared" / "data"))
    if not folder.is_dir():
        pytest.skip(f"no shared data at {folder}; set MBF_DATA to the folder that holds maps/ and meshes/")
    return folder
