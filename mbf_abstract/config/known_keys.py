"""What helps with a key that a block of parameters does not have: its new name, the closest one, or those it has."""

from __future__ import annotations

from collections.abc import Mapping

from pydantic.fields import FieldInfo

from mbf_abstract.config.findings import suggest

_MAX_LISTED_KEYS = 15


def key_hint(key: str, fields: Mapping[str, FieldInfo]) -> str:
    """Return the name that an earlier key has now, or the closest of the known keys, or a list of them."""
    renamed = [name for name, field in fields.items() if _earlier_name(field) == key]
    if renamed:
        return f"it is called {renamed[0]!r} now"
    closest, known = suggest(key, fields), list(fields)
    if closest or not known:
        return closest
    more = ", ..." if len(known) > _MAX_LISTED_KEYS else ""
    return "known keys: " + ", ".join(known[:_MAX_LISTED_KEYS]) + more


def _earlier_name(field: FieldInfo) -> object:
    return field.json_schema_extra.get("was") if isinstance(field.json_schema_extra, dict) else None
