"""Numbers that no robot has, where their unit is not what was meant: degrees for radians, millimetres for metres.

They are legal, so they are noted: a limit of 45 rad/s is none at all.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

from mbf_abstract.parameters import ParameterModel

ANGLES, LENGTHS = "radians are meant, not degrees", "metres are meant, not millimetres"
OF_UNITS = {
    "rad/s": (math.tau, ANGLES),  # a turn a second
    "rad/s^2": (30.0, ANGLES),
    "m/s": (20.0, LENGTHS),
    "m/s^2": (20.0, LENGTHS),
}
"""The most that robots on the ground reach, and what a larger number may be, by units."""
OF_RADII = {"robot_radius": 5.0, "inscribed_radius": 5.0, "inflation_radius": 20.0}
"""The same for radii [m] of robots and around them."""


def implausible_values(parameters: ParameterModel, where: str = "") -> Iterator[str]:
    """Yield a sentence for each finite number of a block beyond what robots have; ``where`` goes before its name."""
    for name, field in type(parameters).model_fields.items():
        value, extra = getattr(parameters, name), field.json_schema_extra
        unit = str(extra.get("unit", "")) if isinstance(extra, dict) else ""
        limit, meant = (OF_RADII.get(name, math.inf), LENGTHS) if unit == "m" else OF_UNITS.get(unit, (math.inf, ""))
        if isinstance(value, int | float) and limit < abs(value) < math.inf:
            yield f"{where}{name} {value:g} {unit} is more than robots have ({limit:.3g} {unit}): {meant}"
