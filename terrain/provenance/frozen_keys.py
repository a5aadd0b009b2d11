"""Hashes of frozen parameters outlive a renamed key: it counts under the name that it was frozen with."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any


def under_frozen_keys(value: Any, frozen: Mapping[str, str]) -> Any:
    """Return the same parameters under the keys that they were frozen with; ``frozen``: today's key -> that key."""
    if isinstance(value, Mapping):
        return {frozen.get(key, key): under_frozen_keys(inner, frozen) for key, inner in value.items()}
    return [under_frozen_keys(inner, frozen) for inner in value] if isinstance(value, list | tuple) else value
