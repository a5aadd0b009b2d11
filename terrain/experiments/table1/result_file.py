"""Writes a result of the experiment as JSON that every reader takes, in which there is no NaN and no Infinity."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from mbf_abstract.whole_files import write_whole


def write_result(file: Path, result: Mapping[str, Any]) -> None:
    """Write a file whole. What is undefined (nan) becomes null, what is infinite the text ``inf`` or ``-inf``."""
    write_whole(file, json.dumps(_plain(result), indent=1, allow_nan=False) + "\n")


def _plain(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {key: _plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None if math.isnan(value) else str(value)
    return value
