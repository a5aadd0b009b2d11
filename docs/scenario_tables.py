"""The reference of scenarios: a section for every block of a scenario file, with the tables of its parameter models."""

from __future__ import annotations

import inspect
from typing import get_args

from parameter_tables import models_in, parameter_table

from mbf_abstract.parameters import ParameterModel
from terrain.scenarios.scenario import Scenario

INTRODUCTION = """\
# Scenario files

<!-- Written by docs/generate_reference.py from the parameter models; do not edit. -->

Every key of a scenario. [Write a scenario](write_a_scenario.md) shows one, and `mbf check FILE` reports every mistake
at once. A default of **required** must be given. Range brackets: `[` includes the bound, `(` does not. Where a block
has several types, its key `type` chooses one.

## Top level
"""


def scenario_page() -> str:
    """Return the text of ``scenario_reference.md``."""
    blocks = {name: models_in(field.annotation) for name, field in Scenario.model_fields.items()}
    shown = {Scenario, *(model for models in blocks.values() for model in models)}
    parts = [INTRODUCTION, parameter_table(Scenario, dynamic=None)]
    for name, models in blocks.items():
        same = next((other for other in blocks if blocks[other] == models), name)
        if same != name and models:
            parts.append(f"## `{name}`\n\nKeys as those of `{same}`.\n")
        elif models:
            parts += [f"## `{name}`\n", *_sections(name, models, shown)]
    return "\n".join(parts)


def _sections(name: str, models: list[type[ParameterModel]], shown: set[type[ParameterModel]]) -> list[str]:
    """A table for each model of a block, and for what is inside of it unless it is shown elsewhere."""
    parts = []
    for model in models:
        fields = model.model_fields
        types = get_args(fields["type"].annotation) if "type" in fields else ()
        heading = f"### `{name}` of type {', '.join(f'`{one}`' for one in types)}\n\n" if types else ""
        summary = " ".join((inspect.getdoc(model) or "").partition("\n\n")[0].replace("``", "`").split())
        keys = [key for key in fields if key != "type"]
        parts.append(f"{heading}{summary}\n\n{parameter_table(model, keys, dynamic=None)}")
        for key in keys:
            inner = [one for one in models_in(fields[key].annotation) if one not in shown]
            shown.update(inner)
            if inner:
                parts += [f"Keys of `{key}`:\n", *_sections(key, inner, shown)]
    return parts
