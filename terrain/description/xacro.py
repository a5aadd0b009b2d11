"""Files of macros: what makes a URDF of them is a program of ROS, which we neither have nor replace."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from mbf_abstract.config.findings import ConfigError, Finding
from terrain.description.xml_source import Element


def refuse_xacro(root: Element, file: Path) -> None:
    """Raise ConfigError where a file has elements of xacro, which stand for others."""
    for element in _all(root):
        if element.tag.startswith("xacro:"):
            expected = "a URDF without xacro (expand it: xacro FILE > robot.urdf)"
            raise ConfigError([Finding(str(file), element.line, "", expected, f"<{element.tag}>")])


def _all(element: Element) -> Iterator[Element]:
    yield element
    for child in element.children:
        yield from _all(child)
