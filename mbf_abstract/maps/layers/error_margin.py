"""Parameter of the layers that keep a margin for errors of the map: one that ``relax`` may shrink for a time."""

from __future__ import annotations

from typing import TypeVar

from mbf_abstract.parameters import ParameterModel, parameter

Margin = TypeVar("Margin", bound="ErrorMargin")


class ErrorMargin(ParameterModel):
    """The parameter every layer has that knows how wrong its map is."""

    error_margin: float = parameter(
        1.0, "How many standard errors of the map the limits are narrowed by.", ge=0.0, le=10.0
    )

    def with_margin(self: Margin, factor: float) -> Margin:
        """Return these with ``factor`` of the margin."""
        return self.model_copy(update={"error_margin": factor * self.error_margin})
