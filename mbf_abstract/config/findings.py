"""Findings: what is wrong in an input file, where, and what was expected; and the error that carries all of them.

Loaders collect findings and raise one ``ConfigError`` at the end, so a user sees every mistake at once.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from difflib import get_close_matches

KeyPath = tuple[str | int, ...]

_GOT_WIDTH = 60


@dataclass(frozen=True)
class Finding:
    """One mistake in one file.

    Attributes
    ----------
    file : str
        The file as the user named it.
    line : int
        Line number, from 1.
    key : str
        Key path such as ``planners[0].type``; empty for the file as a whole.
    expected, got : str
        What would be legal (with range and unit) and what stands there.
    hint : str
        A further help, e.g. the closest legal key.
    """

    file: str
    line: int
    key: str
    expected: str
    got: str
    hint: str = ""

    @property
    def text(self) -> str:
        """The finding as one line: ``file:line: key: expected X, got Y (hint)``."""
        key = f" {self.key}:" if self.key else ""
        hint = f" ({self.hint})" if self.hint else ""
        return f"{self.file}:{self.line}:{key} expected {self.expected}, got {self.got}{hint}"


class ConfigError(Exception):
    """A file was refused; ``findings`` lists everything that is wrong with it, ordered by file and line."""

    def __init__(self, findings: Iterable[Finding]) -> None:
        self.findings = sorted(findings, key=lambda finding: (finding.file, finding.line))
        super().__init__("\n".join(finding.text for finding in self.findings))

    def __reduce__(self) -> tuple[type, tuple[object, ...]]:
        """Survive pickling, for the return from a worker process."""
        return type(self), (self.findings,)


def format_key_path(path: KeyPath) -> str:
    """Return ``planners[0].type`` for ``("planners", 0, "type")``."""
    text = ""
    for part in path:
        text += f"[{part}]" if isinstance(part, int) else f".{part}" if text else part
    return text


def describe_value(value: object) -> str:
    """Return a value as an error text shows it: short, with its quotes, None as ``nothing``."""
    if value is None:
        return "nothing"
    if isinstance(value, dict):
        return f"a block of {len(value)} keys"
    if isinstance(value, list | tuple):
        return f"a list of {len(value)} items"
    text = repr(value)
    return text if len(text) <= _GOT_WIDTH else text[: _GOT_WIDTH - 3] + "..."


@contextmanager
def refused_at(file: str, *key: str | int, expected: str, of: tuple[type[Exception], ...] = ()) -> Iterator[None]:
    """Turn a ValueError of the block, and what else is named, into a ConfigError with one finding about a key.

    A text such as "expected X, got Y" says itself what was expected; else the whole text is what came.
    """
    refusals: tuple[type[Exception], ...] = (ValueError, *of)
    try:
        yield
    except refusals as error:
        wanted, parted, got = text_of(error).partition(", got ")
        wanted, got = (wanted.removeprefix("expected "), got) if parted else (expected, wanted)
        raise ConfigError([Finding(file, 1, format_key_path(key), wanted, got)]) from error


def suggest(word: str, known: Iterable[str]) -> str:
    """Return ``did you mean 'x'?`` with the closest known word, or an empty text if none is close."""
    matches = get_close_matches(word, list(known), n=1, cutoff=0.6)
    return f"did you mean {matches[0]!r}?" if matches else ""


def text_of(error: Exception) -> str:
    """Return the text of an exception, its name where it has none; a line for each wrong parameter; file and reason."""
    from pydantic import ValidationError

    if isinstance(error, ValidationError):
        wrong = [
            (".".join(map(str, one["loc"])) or "parameters", one["msg"], one.get("input")) for one in error.errors()
        ]
        return "\n".join(f"{name}: {text[:1].lower()}{text[1:]}, got {value!r:.60}" for name, text, value in wrong)
    if isinstance(error, OSError) and error.strerror:  # without the number in brackets
        return error.strerror if error.filename is None else f"{error.filename}: {error.strerror}"
    if isinstance(error, MemoryError):
        return f"not enough memory for that: {error}".removesuffix(": ")
    return str(error).strip() or type(error).__name__
