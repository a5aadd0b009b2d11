"""Symbols of incidents, the same on the time bar of a replay and in a picture; no colour is needed to read them."""

from __future__ import annotations

from typing import NamedTuple


class IncidentMark(NamedTuple):
    """How incidents of one kind are shown.

    Attributes
    ----------
    symbol : str
        A character of the time bar.
    marker : str
        The same shape, by its name in matplotlib.
    label : str
        For a legend.
    """

    symbol: str
    marker: str
    label: str


MARKS = {
    "collision": IncidentMark("◆", "D", "collision"),
    "near_miss": IncidentMark("▲", "^", "near miss"),
    "tipped_over": IncidentMark("✖", "X", "tip-over"),
    "slipping": IncidentMark("▼", "v", "slipping"),
    "high_centred": IncidentMark("✚", "P", "high-centred"),
    "stuck": IncidentMark("■", "s", "stuck"),
}
OTHER = IncidentMark("●", "o", "other incident")


def mark_of(what: str) -> IncidentMark:
    """Return the mark of an incident, by the ``what`` of its event; all kinds of collisions share one."""
    return MARKS.get("collision" if what.startswith("collision") else what, OTHER)
