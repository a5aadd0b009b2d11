"""What pydantic has found wrong with a block of parameters, in our words: key, what was expected, what came.

The errors of configuration files and those of changes at run time are made of these, so both read alike.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, get_args

from pydantic import BaseModel
from pydantic.fields import FieldInfo
from pydantic_core import ErrorDetails

from mbf_abstract.config.findings import KeyPath, describe_value, format_key_path
from mbf_abstract.config.known_keys import key_hint

_EXPECTED = {
    "bool_type": "true or false",
    "string_type": "a text",
    "model_type": "a block of keys",
    "dict_type": "a block of keys",
    "list_type": "a list",
    "tuple_type": "a list",
    "path_type": "a file path",
    "path_not_file": "a file that exists",
    "path_not_directory": "a folder that exists",
    "missing": "a value",
    "bool_parsing": "true or false",
}
_NUMBER_ERRORS = {
    "float_type",
    "float_parsing",
    "int_type",
    "int_from_float",
    "finite_number",
    "greater_than",
    "greater_than_equal",
    "less_than",
    "less_than_equal",
}
_SIGNS = {"gt": ">", "ge": ">=", "lt": "<", "le": "<="}


@dataclass(frozen=True)
class Mistake:
    """One key of a block with a wrong value; ``loc`` is its place in the block, the rest as in ``Finding``."""

    loc: KeyPath
    expected: str
    got: str
    hint: str = ""

    def text(self, inside: KeyPath = ()) -> str:
        """One line: ``key: expected X, got Y (hint)``; ``inside`` leads to the block."""
        key = format_key_path((*inside, *self.loc))
        hint = f" ({self.hint})" if self.hint else ""
        return f"{key or 'parameters'}: expected {self.expected}, got {self.got}{hint}"


def mistakes_of(model: type[BaseModel], block: object, errors: list[ErrorDetails]) -> list[Mistake]:
    """Return one mistake for each key of which pydantic has reported errors.

    The alternatives of a union, which it reports one by one, are joined by "or". What is wrong inside one alternative
    goes before that the whole is no other one.
    """
    found: dict[KeyPath, Mistake] = {}
    for error in errors:
        loc = _location_in_data(block, error)
        mistake = _mistake_of(model, error, loc)
        earlier = found.get(loc)
        if earlier is not None and earlier.expected != mistake.expected:
            expected = f"{earlier.expected} or {mistake.expected}"
            mistake = Mistake(loc, expected, mistake.got, mistake.hint)
        found[loc] = mistake
    inside = {loc[:length] for loc in found for length in range(1, len(loc))}
    return [mistake for loc, mistake in found.items() if loc not in inside]


def describe_range(field: FieldInfo, broken: Mapping[str, float] | None = None) -> str:
    """Return a field's legal range and unit as text, e.g. ``> 0 and <= 5 m``; empty if it has neither.

    A field of several numbers has no range of its own: then that of the number that is wrong, as ``broken`` names it,
    e.g. ``{"gt": 0.0}``.
    """
    bounds = []
    for name, sign in _SIGNS.items():
        bounds += [f"{sign} {getattr(part, name):g}" for part in field.metadata if hasattr(part, name)]
    bounds = bounds or [f"{_SIGNS[name]} {bound:g}" for name, bound in (broken or {}).items() if name in _SIGNS]
    extra = field.json_schema_extra
    unit = str(extra.get("unit", "")) if isinstance(extra, dict) else ""
    if not bounds:
        return f"in {unit}" if unit else ""
    return " ".join(part for part in (" and ".join(bounds), unit) if part)


def _mistake_of(model: type[BaseModel], error: ErrorDetails, loc: KeyPath) -> Mistake:
    if error["type"] == "extra_forbidden":
        hint = key_hint(str(loc[-1]), _fields_at(model, loc[:-1]))
        return Mistake(loc, "a known key", repr(loc[-1]), hint)
    if error["type"].startswith("union_tag"):
        return _mistake_of_tag(error, loc)
    got = "nothing" if error["type"] == "missing" else describe_value(error["input"])
    expected, seen, came = _expected(model, error, loc).partition(", got ")
    return Mistake(loc, expected, came if seen else got)  # a validator of ours may have said itself what came


def _mistake_of_tag(error: ErrorDetails, loc: KeyPath) -> Mistake:
    """A block whose key that says what it is has none of the known values, or is missing."""
    tags = error["ctx"].get("expected_tags", "")
    got = repr(error["ctx"]["tag"]) if tags else "nothing"
    key = error["ctx"]["discriminator"].strip("'")
    return Mistake((*loc, key), f"one of {tags}" if tags else "a value", got)


def _expected(model: type[BaseModel], error: ErrorDetails, loc: KeyPath) -> str:
    field = _field_at(model, loc)
    limits = describe_range(field, error.get("ctx")) if field is not None else ""
    if error["type"] in _NUMBER_ERRORS:
        whole = error["type"].startswith("int") or (field is not None and field.annotation is int)
        number = "a whole number" if whole else "a finite number" if error["type"] == "finite_number" else "a number"
        return f"{number} {limits}".strip()
    if error["type"] == "missing":
        return f"a value {limits}".strip()
    if error["type"] == "too_long" and error["ctx"]["field_type"] == "Tuple":
        return f"a list of {error['ctx']['max_length']} items"
    if error["type"] == "too_short" and error["ctx"]["field_type"] == "Tuple":
        return f"a list of at least {error['ctx']['min_length']} items"
    text = _EXPECTED.get(error["type"]) or error["msg"].removeprefix("Value error, ")
    return text.removeprefix("Input should be ").removeprefix("expected ")


def _location_in_data(block: object, error: ErrorDetails) -> KeyPath:
    """Return pydantic's location without the parts that name alternatives of a union, which are not in the data."""
    loc: KeyPath = ()
    for part in error["loc"]:
        known = range(len(block)) if isinstance(block, list | tuple) else block if isinstance(block, dict) else ()
        if part in known:
            loc = (*loc, part)
            block = block[part]  # type: ignore[index]
    return (*loc, error["loc"][-1]) if error["type"] == "missing" else loc


def _field_at(model: type[BaseModel], loc: KeyPath) -> FieldInfo | None:
    """Return the field that a location ends in, or whose items it points into."""
    field: FieldInfo | None = None
    current: type[BaseModel] | None = model
    for part in loc:
        is_key_of_mapping = field is not None and current is not None and part not in current.model_fields
        if isinstance(part, str) and not is_key_of_mapping:
            field = current.model_fields.get(part) if current is not None else None
            current = inner_model(field.annotation) if field is not None else None
    return field


def _fields_at(model: type[BaseModel], loc: KeyPath) -> dict[str, FieldInfo]:
    """Fields of the block at a location by their keys, those of all alternatives if there are several."""
    field = _field_at(model, loc)
    models = [] if field is None else _models_in(field.annotation)
    return {key: inner for found in models or [model] for key, inner in found.model_fields.items()}


def inner_model(annotation: Any) -> type[BaseModel] | None:
    """The first model of blocks that a type names, e.g. ``Source`` of ``dict[str, Source]``; None if it names none."""
    return next(iter(_models_in(annotation)), None)


def _models_in(annotation: Any) -> list[type[BaseModel]]:
    arguments = get_args(annotation)  # for Python 3.10 tuple[float, float] is a type, too
    if not arguments and isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    return [found for arg in arguments for found in _models_in(arg)]
