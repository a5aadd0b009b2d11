"""Typed parameters: one declaration gives the default, the unit, the range, the error text and the docs page.

Example
-------
>>> class Parameters(PluginParameters):
...     look_ahead: float = parameter(0.6, "Distance of the carrot along the path.", unit="m", gt=0.0, le=10.0)
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import Any, TypeVar

from pydantic import BaseModel, ConfigDict, Field

from mbf_abstract.config.known_keys import key_hint


class ParameterModel(BaseModel):
    """Base of every parameter block: unknown keys and non-finite numbers are refused, values are frozen."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False, validate_default=True)


class PluginParameters(ParameterModel):
    """Parameters of one plugin instance; derive it in the plugin's module. Without parameters use it as it is."""


Parameters = TypeVar("Parameters", bound=ParameterModel)


def with_changes(
    parameters: Parameters, changes: Mapping[str, Any], read_once: Collection[str] | None = None
) -> Parameters:
    """Return validated parameters in which some values are changed at run time.

    Parameters
    ----------
    read_once : collection of str, optional
        What must stay; without it all that is declared as not dynamic.

    Raises
    ------
    ValueError
        There is no such parameter, a value is not legal (pydantic's ValidationError is one), or a parameter is read
        only once, at the start.
    """
    model = type(parameters)
    unknown = [key for key in changes if key not in model.model_fields]
    if unknown:
        hints = [(key, key_hint(key, model.model_fields)) for key in unknown]
        raise ValueError("; ".join(f"{key}: expected a known parameter{hint and ', ' + hint}" for key, hint in hints))
    new = model.model_validate({**parameters.model_dump(), **changes})
    if read_once is None:
        fields = model.model_fields.items()
        read_once = [name for name, field in fields if not (field.json_schema_extra or {}).get("dynamic", True)]  # type: ignore[union-attr]
    fixed = [name for name in read_once if getattr(new, name) != getattr(parameters, name)]
    if fixed:
        raise ValueError(f"{', '.join(fixed)}: read once, at the start, and cannot be changed at run time")
    return new


def parameter(
    default: Any,
    description: str,
    *,
    unit: str = "",
    was: str = "",
    dynamic: bool = True,
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
        json_schema_extra={"unit": unit, "was": was, "dynamic": dynamic},
    )
