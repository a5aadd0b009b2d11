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
from pydantic_core import ErrorDetails

from mbf_abstract.config.bounded_files import configured_file
from mbf_abstract.config.findings import Finding, KeyPath
from mbf_abstract.config.mistakes import inner_model, mistakes_of
from mbf_abstract.config.yaml_source import YamlDocument
from mbf_abstract.parameters import ParameterModel

Model = TypeVar("Model", bound=ParameterModel)


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


def findings_of(
    model: type[BaseModel], block: object, errors: list[ErrorDetails], document: YamlDocument, key_path: KeyPath
) -> list[Finding]:
    """Return one finding for each key of which pydantic has reported errors, see ``mistakes_of``."""
    return [
        document.finding((*key_path, *one.loc), one.expected, one.got, one.hint)
        for one in mistakes_of(model, block, errors)
    ]


def _with_absolute_paths(model: type[BaseModel], data: object, folder: Path) -> object:
    """Copy of ``data`` whose texts in fields of type ``Path`` are absolute; ``~`` is the home folder."""
    if not isinstance(data, Mapping):
        return data
    resolved = dict(data)
    for name, field in model.model_fields.items():
        value = resolved.get(name)
        inner = inner_model(field.annotation)
        if isinstance(value, str) and _holds_a_path(field.annotation):
            resolved[name] = str(configured_file(folder.absolute(), value))
        elif inner is not None and isinstance(value, list):
            resolved[name] = [_with_absolute_paths(inner, item, folder) for item in value]
        elif inner is not None and isinstance(value, Mapping):
            resolved[name] = _with_absolute_paths(inner, value, folder)
    return resolved


def _holds_a_path(annotation: Any) -> bool:
    return annotation is Path or any(_holds_a_path(arg) for arg in get_args(annotation))
