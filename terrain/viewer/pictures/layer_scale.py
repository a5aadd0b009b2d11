"""Which layers of a map are worth drawing, and the costs at which their scales of colours end."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from terrain.recording.recorded_maps import RecordedLayer

ABOVE_SCALE = 0.01
"""Share of the costs beyond the end of a scale, so that a single spike does not make all others pale."""


def shown_layers(layers: Sequence[RecordedLayer], names: Sequence[str] = ()) -> list[RecordedLayer]:
    """The layers with these names, in this order; without any all whose costs differ."""
    by_name = {layer.name: layer for layer in layers}
    return [by_name[name] for name in names if name in by_name] or [layer for layer in layers if _differs(layer)]


def end_of_scale(layer: RecordedLayer) -> float:
    """What all but ``ABOVE_SCALE`` of the finite costs are below; the highest if that is 0, 1 without any."""
    finite = layer.costs[np.isfinite(layer.costs)].astype(np.float64)
    if not len(finite):
        return 1.0
    return float(np.quantile(finite, 1.0 - ABOVE_SCALE)) or float(finite.max()) or 1.0


def range_text(layer: RecordedLayer) -> str:
    """What the colours of a layer stand for, such as ``0 to 0.35 rad``."""
    return f"0 to {end_of_scale(layer):.2g} {layer.unit}".rstrip()


def _differs(layer: RecordedLayer) -> bool:
    return bool((layer.costs != layer.costs[:1]).any())
