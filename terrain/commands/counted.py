"""A number with its noun, for texts of commands and pages."""

from __future__ import annotations


def counted(number: int, noun: str) -> str:
    """Return e.g. "1 world", "3 worlds"; for nouns whose plural ends in s."""
    return f"{number} {noun}" if number == 1 else f"{number} {noun}s"
