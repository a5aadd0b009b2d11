"""Plain XML with line numbers: elements and attributes, read whole, from files of unknown origin.

Entities that a file declares are refused, because a few lines of them can expand to gigabytes; so are files that are
too large, too deep, or no files at all. Text between elements and namespaces are ignored.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from xml.parsers import expat

from mbf_abstract.config.bounded_files import special_file
from mbf_abstract.config.findings import ConfigError, Finding

MAX_BYTES = 20_000_000
MAX_ELEMENTS = 200_000
MAX_DEPTH = 64


@dataclass(frozen=True)
class Element:
    """One element, its attributes, and where it begins."""

    tag: str
    attributes: Mapping[str, str]
    line: int
    children: list[Element] = field(default_factory=list)

    def all(self, tag: str) -> Iterator[Element]:
        """Children of this name, in order."""
        return (child for child in self.children if child.tag == tag)

    def first(self, tag: str) -> Element | None:
        """The first child of this name."""
        return next(self.all(tag), None)


class _Refused(Exception):
    """The file breaks a rule of this module."""


def read_xml(path: Path) -> Element:
    """Read the root element of a file.

    Raises
    ------
    ConfigError
        The file cannot be read, is no well-formed XML, or breaks a rule of this module.
    """
    if kind := special_file(path):
        raise ConfigError([Finding(str(path), 1, "", "a file", kind)])
    try:
        with path.open("rb") as file:
            data = file.read(MAX_BYTES + 1)
    except (OSError, ValueError) as error:
        raise ConfigError([Finding(str(path), 1, "", "a file that can be read", str(error))]) from error
    if len(data) > MAX_BYTES:
        raise ConfigError([Finding(str(path), 1, "", f"at most {MAX_BYTES} bytes", "more")])
    builder = _Builder()
    try:
        return builder.build(data)
    except expat.ExpatError as error:
        text = expat.ErrorString(error.code)
        raise ConfigError([Finding(str(path), error.lineno, "", "well-formed XML", text)]) from error
    except _Refused as error:
        raise ConfigError([Finding(str(path), builder.line, "", *error.args)]) from error


class _Builder:
    """Collects the elements that the parser reports."""

    def __init__(self) -> None:
        self._parser = expat.ParserCreate()
        self._parser.StartElementHandler = self._start
        self._parser.EndElementHandler = self._end
        self._parser.EntityDeclHandler = self._refuse_entity
        self._open: list[Element] = []
        self._root: Element | None = None
        self._count = 0

    @property
    def line(self) -> int:
        return self._parser.CurrentLineNumber

    def build(self, data: bytes) -> Element:
        try:
            self._parser.Parse(data, True)
        except (LookupError, UnicodeError) as error:
            raise _Refused("an encoding that is known", str(error)) from error
        if self._root is None:
            raise _Refused("an element", "none")
        return self._root

    def _start(self, tag: str, attributes: dict[str, str]) -> None:
        self._count += 1
        if self._count > MAX_ELEMENTS:
            raise _Refused(f"at most {MAX_ELEMENTS} elements", "more")
        if len(self._open) >= MAX_DEPTH:
            raise _Refused(f"at most {MAX_DEPTH} levels of elements", "more")
        element = Element(tag, attributes, self.line)
        if self._open:
            self._open[-1].children.append(element)
        else:
            self._root = element
        self._open.append(element)

    def _end(self, tag: str) -> None:
        self._open.pop()

    def _refuse_entity(self, name: str, *rest: object) -> None:
        raise _Refused("no entities of its own", f"the entity {name!r}")


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
