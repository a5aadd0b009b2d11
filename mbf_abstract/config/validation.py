"""Validation of blocks of a YAML document against parameter models, with findings instead of exceptions.

Types are strict: ``"5"``, ``5.0`` and ``true`` are no whole numbers, but ``5`` is a number, a list is a tuple, and a
text is an enum value or a file path. A relative file path counts from the folder of the file it stands in.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any, TypeVar, get_args

from pydantic import BaseModel, ValidationError
from pydantic.fields import FieldInfo
from pydantic_core import ErrorDetails

from mbf_abstract.config.bounded_files import configured_file
from mbf_abstract.config.findings import Finding, KeyPath, describe_value
from mbf_abstract.config.known_keys import key_hint
from mbf_abstract.config.yaml_source import YamlDocument
from mbf_abstract.parameters import ParameterModel

Model = TypeVar("Model", bound=ParameterModel)

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


def validate(
    model: type[Model],
    data: object,
    document: YamlDocument,
    key_path: KeyPath,
    findings: list[Finding],
    context: Mapping[str, Any] | None = None,
) -> Model | None:
    """Make a ``model`` of one block of a document.

    Parameters
    ----------
    data : object
        The block, usually a mapping; None counts as an empty block.
    document : YamlDocument
        Where the block comes from; gives lines and the folder of relative paths.
    key_path : KeyPath
        Where the block stands in the document.
    findings : list of Finding
        Everything that is wrong is appended here.
    context : mapping, optional
        What validators of the model may ask for as ``info.context``.

    Returns
    -------
    Model or None
        None if something is wrong with this block.
    """
    block = {} if data is None else _with_absolute_paths(model, data, document.path.parent)
    try:
        return model.model_validate_json(json.dumps(block, default=str), strict=True, context=context)
    except ValidationError as error:
        findings.extend(findings_of(model, block, error.errors(include_url=False), document, key_path))
        return None


def describe_range(field: FieldInfo) -> str:
    """Return a field's legal range and unit as text, e.g. ``> 0 and <= 5 m``; empty if it has neither."""
    bounds = []
    for name, sign in (("gt", ">"), ("ge", ">="), ("lt", "<"), ("le", "<=")):
        bounds += [f"{sign} {getattr(part, name):g}" for part in field.metadata if hasattr(part, name)]
    extra = field.json_schema_extra
    unit = str(extra.get("unit", "")) if isinstance(extra, dict) else ""
    return " ".join(part for part in (" and ".join(bounds), unit) if part)


def findings_of(
    model: type[BaseModel], block: object, errors: list[ErrorDetails], document: YamlDocument, key_path: KeyPath
) -> list[Finding]:
    """Return one finding for each key of which pydantic has reported errors.

    The alternatives of a union, which it reports one by one, are joined by "or". What is wrong inside one alternative
    goes before that the whole is no other one.
    """
    found: dict[KeyPath, Finding] = {}
    for error in errors:
        loc = _location_in_data(block, error)
        finding = _finding_of(model, error, loc, document, key_path)
        earlier = found.get(loc)
        if earlier is not None and earlier.expected != finding.expected:
            expected = f"{earlier.expected} or {finding.expected}"
            finding = document.finding((*key_path, *loc), expected, finding.got, finding.hint)
        found[loc] = finding
    inside = {loc[:length] for loc in found for length in range(1, len(loc))}
    return [finding for loc, finding in found.items() if loc not in inside]


def _finding_of(
    model: type[BaseModel], error: ErrorDetails, loc: KeyPath, document: YamlDocument, key_path: KeyPath
) -> Finding:
    path = (*key_path, *loc)
    if error["type"] == "extra_forbidden":
        hint = key_hint(str(loc[-1]), _fields_at(model, loc[:-1]))
        return document.finding(path, "a known key", repr(loc[-1]), hint)
    if error["type"].startswith("union_tag"):
        return _finding_of_tag(error, document, path)
    got = "nothing" if error["type"] == "missing" else describe_value(error["input"])
    return document.finding(path, _expected(model, error, loc), got)


def _finding_of_tag(error: ErrorDetails, document: YamlDocument, path: KeyPath) -> Finding:
    """A block whose key that says what it is has none of the known values, or is missing."""
    tags = error["ctx"].get("expected_tags", "")
    got = repr(error["ctx"]["tag"]) if tags else "nothing"
    key = error["ctx"]["discriminator"].strip("'")
    return document.finding((*path, key), f"one of {tags}" if tags else "a value", got)


def _expected(model: type[BaseModel], error: ErrorDetails, loc: KeyPath) -> str:
    field = _field_at(model, loc)
    limits = describe_range(field) if field is not None else ""
    if error["type"] in _NUMBER_ERRORS:
        whole = error["type"].startswith("int") or (field is not None and field.annotation is int)
        number = "a whole number" if whole else "a finite number" if error["type"] == "finite_number" else "a number"
        return f"{number} {limits}".strip()
    if error["type"] == "missing":
        return f"a value {limits}".strip()
    text = _EXPECTED.get(error["type"]) or error["msg"].removeprefix("Value error, ")
    return text.removeprefix("Input should be ")


def _location_in_data(block: object, error: ErrorDetails) -> KeyPath:
    """Return pydantic's location without the parts that name alternatives of a union, which are not in the data."""
    loc: KeyPath = ()
    for part in error["loc"]:
        known = range(len(block)) if isinstance(block, list) else block if isinstance(block, dict) else ()
        if part in known:
            loc = (*loc, part)
            block = block[part]  # type: ignore[index]
    return (*loc, error["loc"][-1]) if error["type"] == "missing" else loc


def _field_at(model: type[BaseModel], loc: KeyPath) -> FieldInfo | None:
    """Return the field that a location ends in, or whose items it points into."""
    field: FieldInfo | None = None
    current: type[BaseModel] | None = model
    for part in loc:
        if isinstance(part, str):
            field = current.model_fields.get(part) if current is not None else None
            current = _inner_model(field.annotation) if field is not None else None
    return field


def _fields_at(model: type[BaseModel], loc: KeyPath) -> dict[str, FieldInfo]:
    """Fields of the block at a location by their keys, those of all alternatives if there are several."""
    field = _field_at(model, loc)
    models = [] if field is None else _models_in(field.annotation)
    return {key: inner for found in models or [model] for key, inner in found.model_fields.items()}


def _inner_model(annotation: Any) -> type[BaseModel] | None:
    return next(iter(_models_in(annotation)), None)


def _models_in(annotation: Any) -> list[type[BaseModel]]:
    arguments = get_args(annotation)  # for Python 3.10 tuple[float, float] is a type, too
    if not arguments and isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    return [found for arg in arguments for found in _models_in(arg)]


def _with_absolute_paths(model: type[BaseModel], data: object, folder: Path) -> object:
    """Copy of ``data`` whose texts in fields of type ``Path`` are absolute; ``~`` is the home folder."""
    if not isinstance(data, Mapping):
        return data
    resolved = dict(data)
    for name, field in model.model_fields.items():
        value = resolved.get(name)
        inner = _inner_model(field.annotation)
        if isinstance(value, str) and _holds_a_path(field.annotation):
            resolved[name] = str(configured_file(folder.absolute(), value))
        elif inner is not None and isinstance(value, list):
            resolved[name] = [_with_absolute_paths(inner, item, folder) for item in value]
        elif inner is not None and isinstance(value, Mapping):
            resolved[name] = _with_absolute_paths(inner, value, folder)
    return resolved


def _holds_a_path(annotation: Any) -> bool:
    return annotation is Path or any(_holds_a_path(arg) for arg in get_args(annotation))
