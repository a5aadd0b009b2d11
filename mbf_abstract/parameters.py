"""Typed parameters: one declaration gives the default, the unit, the range, the error text and the docs page.

Example
-------
>>> class Parameters(PluginParameters):
...     look_ahead: float = parameter(0.6, "Distance of the carrot along the path.", unit="m", gt=0.0, le=10.0)
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import replace
from typing import Any, TypeVar

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from mbf_abstract.config.findings import KeyPath, describe_value, format_key_path
from mbf_abstract.config.mistakes import mistakes_of


class ParameterModel(BaseModel):
    """Base of every parameter block: unknown keys and non-finite numbers are refused, values are frozen."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False, validate_default=True)


class PluginParameters(ParameterModel):
    """Parameters of one plugin instance; derive it in the plugin's module. Without parameters use it as it is."""


Parameters = TypeVar("Parameters", bound=ParameterModel)


class ParameterError(ValueError):
    """Values that a block of parameters does not take; for each ``key: expected X with range and unit, got Y``."""


def checked_parameters(model: type[Parameters], values: Mapping[str, Any], where: KeyPath = ()) -> Parameters:
    """Make the parameters of a block; ``where`` leads to it, for the text of the ParameterError that this may raise."""
    return _made(model, values, values, where)


def _made(model: type[Parameters], values: Mapping[str, Any], new: Mapping[str, Any], where: KeyPath) -> Parameters:
    """Make parameters; what is wrong with a block as a whole is said of its ``new`` values."""
    block = dict(values)
    try:
        return model.model_validate(block)
    except ValidationError as error:
        wrong = mistakes_of(model, block, error.errors(include_url=False))
    came = ", ".join(f"{key}: {describe_value(value)}" for key, value in new.items())
    texts = [(one if one.loc else replace(one, got=came or one.got)).text(where) for one in wrong]
    raise ParameterError("; ".join(texts))


def with_changes(
    parameters: Parameters, changes: Mapping[str, Any], read_once: Collection[str] | None = None, where: KeyPath = ()
) -> Parameters:
    """Return validated parameters in which some values are changed at run time.

    Parameters
    ----------
    read_once : collection of str, optional
        What must stay; without it all that is declared as not dynamic.
    where : key path
        Leads to the block, for texts of errors.

    Raises
    ------
    ParameterError
        There is no such parameter, a value is not legal, or a parameter is read only once, at the start.
    """
    model = type(parameters)
    new = _made(model, {**parameters.model_dump(), **changes}, changes, where)
    if read_once is None:
        fields = model.model_fields.items()
        read_once = [name for name, field in fields if not (field.json_schema_extra or {}).get("dynamic", True)]  # type: ignore[union-attr]
    fixed = [name for name in read_once if getattr(new, name) != getattr(parameters, name)]
    if fixed:
        keys = ", ".join(format_key_path((*where, name)) for name in fixed)
        raise ParameterError(f"{keys}: read once, at the start, and cannot be changed at run time")
    return new


def parameter(
    default: Any,
    description: str,
    *,
    unit: str = "",
    was: str = "",
    dynamic: bool = True,
    reads_file: bool = False,
    ge: float | None = None,
    gt: float | None = None,
    le: float | None = None,
    lt: float | None = None,
    allow_inf: bool = False,
) -> Any:
    """Declare one parameter of a ``ParameterModel``.

    Parameters
    ----------
    default : object
        The default; ``...`` makes the parameter required.
    description : str
        One sentence for the docs page.
    unit : str
        SI unit, empty for a pure number or a text.
    was : str
        Its earlier name, which is refused with a hint to this one.
    dynamic : bool
        Whether a change at run time takes effect on running goals; otherwise it is read when a goal starts.
    reads_file : bool
        Whether a text that is not empty names a file, which has to be there.
    ge, gt, le, lt : float, optional
        Bounds of the legal range.
    allow_inf : bool
        Accept ``.inf`` (e.g. an unlimited range).
    """
    return Field(
        default,
        description=description,
        ge=ge,
        gt=gt,
        le=le,
        lt=lt,
        allow_inf_nan=True if allow_inf else None,
        json_schema_extra={"unit": unit, "was": was, "dynamic": dynamic, "reads_file": reads_file},
    )
