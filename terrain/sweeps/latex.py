"""The summary of a sweep as a table for a paper, in LaTeX with the package booktabs."""

from __future__ import annotations

from collections.abc import Sequence

from terrain.sweeps.statistics import METRICS, Row, decimals_for, quartiles_of, rate_of, values_of
from terrain.sweeps.variants import common_settings, short_names

SPECIAL = {
    **{sign: f"\\{sign}" for sign in "&%$#_{}"},
    **{"\\": r"\textbackslash{}", "~": r"\textasciitilde{}", "^": r"\textasciicircum{}"},
    **{"<": r"\textless{}", ">": r"\textgreater{}"},
}


def latex_table(rows: Sequence[Row]) -> str:
    """Return a table with a line per variant: successes with their interval, and medians with their quartiles."""
    names = sorted({row["variant"] for row in rows})
    runs = {name: [row for row in rows if row["variant"] == name] for name in names}
    shown = [metric for metric in METRICS if any(values_of(of, metric) for of in runs.values())]
    lines = [
        r"% Needs \usepackage{booktabs}. Success: share of the runs [%] with Wilson's 95 % interval;",
        r"% else the median, with the quartiles below.",
        *(f"% All variants have {shared}." for shared in [", ".join(common_settings(names))] if shared),
        rf"\begin{{tabular}}{{l{'r' * (len(shown) + 1)}}}",
        r"\toprule",
        " & ".join(["variant", r"success [\%]", *(escaped(metric.title) for metric in shown)]) + r" \\",
        r"\midrule",
    ]
    decimals = [decimals_for([values_of(of, metric) for of in runs.values()]) for metric in shown]
    short = short_names(names)
    for name, of in runs.items():
        rate, columns = rate_of(of), [values_of(of, metric) for metric in shown]
        first = [escaped(short[name]), f"{100 * rate.share:.0f}", *map(_median, columns, decimals)]
        second = ["", f"({100 * rate.low:.0f}--{100 * rate.high:.0f})", *map(_quartiles, columns, decimals)]
        lines += [" & ".join(first) + r" \\", " & ".join(second) + r" \\"]
    return "\n".join([*lines, r"\bottomrule", r"\end{tabular}", ""])


def escaped(text: str) -> str:
    """Return a text in which LaTeX finds no commands."""
    return "".join(SPECIAL.get(sign, sign) for sign in text)


def _median(values: Sequence[float], decimals: int) -> str:
    return f"{quartiles_of(values)[1]:.{decimals}f}" if values else "--"


def _quartiles(values: Sequence[float], decimals: int) -> str:
    if not values:
        return ""
    lower, _, upper = quartiles_of(values)
    return f"({lower:.{decimals}f}--{upper:.{decimals}f})"
