"""The scenarios that come with the package, by name; nothing is read, so this is there at once."""

from __future__ import annotations

from pathlib import Path

LIBRARY = Path(__file__).parent
"""Folder of the scenarios and of the configurations that they name."""


def shipped_scenarios() -> dict[str, Path]:
    """Names and files of the scenarios, in the order of their names."""
    return {file.stem: file for file in sorted(LIBRARY.glob("*.yaml"))}
