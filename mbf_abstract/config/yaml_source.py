"""Safe YAML with line numbers: plain values only, and for each key path the line where it stands.

Only YAML's own types are read (mapping, list, text, number, bool, null). A file is refused if it is too large, nested
too deep, expands too many aliases, holds a key twice, or is not a mapping at the top. Merge keys (``<<``) are refused,
because a key would then not have one line. Half of a surrogate pair, which no file can hold, is spelled out as its
escape. Numbers such as ``1e-3`` are numbers, as in YAML 1.2.
"""

from __future__ import annotations

import os
import re
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import yaml

from mbf_abstract.config.bounded_files import special_file
from mbf_abstract.config.findings import ConfigError, Finding, KeyPath, describe_value, format_key_path
from mbf_abstract.event_values import well_formed

MAX_BYTES = 1_000_000
MAX_DEPTH = 32
MAX_ALIASES = 100
MAX_VALUES = 100_000
MAX_INT_BITS = 63  # a longer one is a mistake, and Python refuses to print the longest

_PLAIN_TAGS = {
    f"tag:yaml.org,2002:{name}" for name in ("null", "bool", "int", "float", "str", "timestamp", "map", "seq")
}


@dataclass(frozen=True)
class YamlDocument:
    """A mapping read from a file.

    Attributes
    ----------
    path : Path
        The file.
    data : dict
        Its values; changing them does not change the file.
    lines : mapping of key path to int
        Line (from 1) of each key and list item.
    """

    path: Path
    data: dict[str, Any]
    lines: Mapping[KeyPath, int] = field(default_factory=dict, repr=False)

    def line(self, path: KeyPath) -> int:
        """Line of ``path``, or of the nearest enclosing key that is in the file."""
        while path and path not in self.lines:
            path = path[:-1]
        return self.lines.get(path, 1)

    def finding(self, path: KeyPath, expected: str, got: str, hint: str = "") -> Finding:
        """Make a finding about the value at ``path``."""
        return Finding(str(self.path), self.line(path), format_key_path(path), expected, got, hint)

    def located(self, finding: Finding) -> Finding:
        """Return a finding about one of its keys with this file, and the line of the key or of the one around it."""
        around = {format_key_path(path): line for path, line in self.lines.items()}
        known = (key for key in around if re.match(re.escape(key) + r"(?![^.\[])", finding.key))
        return replace(finding, file=str(self.path), line=around.get(max(known, key=len, default=""), 1))


def load_yaml(path: str | os.PathLike[str]) -> YamlDocument:
    """Read a YAML file whose top level is a mapping.

    Raises
    ------
    ConfigError
        The file cannot be read or breaks a rule of this module; all findings at once.
    """
    findings: list[Finding] = []
    document = read_yaml(path, findings)
    if findings or document is None:
        raise ConfigError(findings)
    return document


def read_yaml(path: str | os.PathLike[str], findings: list[Finding]) -> YamlDocument | None:
    """Like ``load_yaml``, but append what is wrong to ``findings``; None if nothing usable is left."""
    path = Path(path)
    text = _read_text(path, findings)
    if text is None:
        return None
    try:
        return _Reader(path, findings).read(text)
    except _LimitError as error:
        findings.append(error.finding)
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        problem = getattr(error, "problem", None) or str(error).splitlines()[0]
        findings.append(Finding(str(path), mark.line + 1 if mark else 1, "", "YAML", problem))
    return None


def _read_text(path: Path, findings: list[Finding]) -> str | None:
    try:
        if kind := special_file(path):
            findings.append(Finding(str(path), 1, "", "a file", kind))
            return None
        with path.open("rb") as file:
            content = file.read(MAX_BYTES + 1)
    except (OSError, ValueError) as error:  # ValueError: a name with a null character
        findings.append(Finding(str(path), 1, "", "a readable file", getattr(error, "strerror", None) or str(error)))
        return None
    if len(content) > MAX_BYTES:
        findings.append(Finding(str(path), 1, "", f"at most {MAX_BYTES} bytes", "a larger file"))
        return None
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = content[: error.start].count(b"\n") + 1
        findings.append(Finding(str(path), line, "", "UTF-8 text", f"byte 0x{content[error.start]:02x}"))
        return None


class _LimitError(Exception):
    """Reading further is pointless; ends the walk."""

    def __init__(self, finding: Finding) -> None:
        super().__init__(finding.text)
        self.finding = finding


class _Loader(yaml.SafeLoader):
    """PyYAML's safe loader that counts aliases and nesting while it composes, and reads ``1e-3`` as a number."""

    source = ""
    depth = 0
    aliases = 0

    def compose_node(self, parent: Any, index: Any) -> Any:
        line = self.peek_event().start_mark.line + 1  # type: ignore[no-untyped-call]
        self.aliases += self.check_event(yaml.AliasEvent)
        if self.aliases > MAX_ALIASES:
            raise _LimitError(Finding(self.source, line, "", f"at most {MAX_ALIASES} aliases", "more"))
        self.depth += 1
        if self.depth > MAX_DEPTH:
            raise _LimitError(Finding(self.source, line, "", f"at most {MAX_DEPTH} levels of nesting", "more"))
        node = super().compose_node(parent, index)
        self.depth -= 1
        return node


_Loader.add_implicit_resolver(
    "tag:yaml.org,2002:float", re.compile(r"^[-+]?(\d+\.?\d*|\.\d+)[eE][-+]?\d+$"), list("-+.0123456789")
)


class _Reader:
    """Turns a node tree into values, keeping lines."""

    def __init__(self, path: Path, findings: list[Finding]) -> None:
        self._path = path
        self._findings = findings
        self._lines: dict[KeyPath, int] = {}
        self._values = 0

    def read(self, text: str) -> YamlDocument | None:
        self._loader = loader = _Loader(text)
        loader.source = str(self._path)
        try:
            root = loader.get_single_node()
            if root is None:
                self._report(1, (), "a mapping of keys to values", "an empty file")
                return None
            data = self._construct(root, ())
        finally:
            loader.dispose()
        if not isinstance(data, dict):
            self._report(root.start_mark.line + 1, (), "a mapping of keys to values", describe_value(data))
            return None
        return YamlDocument(self._path, data, self._lines)

    def _construct(self, node: yaml.Node, path: KeyPath) -> Any:
        line = node.start_mark.line + 1
        self._values += 1
        if self._values > MAX_VALUES or len(path) > MAX_DEPTH:
            limit = f"at most {MAX_VALUES} values, nested at most {MAX_DEPTH} deep, aliases expanded"
            raise _LimitError(Finding(str(self._path), line, format_key_path(path[:4]), limit, "more"))
        if node.tag not in _PLAIN_TAGS:
            self._report(line, path, "a plain value", f"the YAML tag {node.tag!r}")
            return None
        if isinstance(node, yaml.MappingNode):
            return self._construct_mapping(node, path)
        if isinstance(node, yaml.SequenceNode):
            for index, item in enumerate(node.value):
                self._lines.setdefault((*path, index), item.start_mark.line + 1)
            return [self._construct(item, (*path, index)) for index, item in enumerate(node.value)]
        try:
            value = self._loader.construct_object(node)
        except (ValueError, OverflowError) as error:  # e.g. a date with month 13
            reason = str(error).partition(";")[0]
            self._report(line, path, "a plain value", f"{describe_value(node.value)} ({reason})")
            return None
        if isinstance(value, int) and value.bit_length() > MAX_INT_BITS:
            self._report(line, path, f"a whole number of at most {MAX_INT_BITS} bits", describe_value(node.value))
            return None
        return well_formed(value) if isinstance(value, str) else value

    def _construct_mapping(self, node: yaml.MappingNode, path: KeyPath) -> dict[str, Any]:
        values: dict[str, Any] = {}
        for key_node, value_node in node.value:
            line = key_node.start_mark.line + 1
            if key_node.tag != "tag:yaml.org,2002:str":
                self._report(line, path, "a text as key", repr(key_node.value)[:60])
                continue
            key = well_formed(key_node.value)
            place = (*path, key)
            if key in values:
                first = self._lines[place]
                self._report(line, place, "each key once", f"{key!r} a second time", f"first in line {first}")
                continue
            self._lines[place] = line
            values[key] = self._construct(value_node, place)
        return values

    def _report(self, line: int, path: KeyPath, expected: str, got: str, hint: str = "") -> None:
        self._findings.append(Finding(str(self._path), line, format_key_path(path), expected, got, hint))
