"""The summary of a sweep as a table for a paper, in LaTeX with the package booktabs."""

from __future__ import annotations

from collections.abc import Sequence

from terrain.sweeps.statistics import METRICS, Row, quartiles_of, rate_of, values_of

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
        rf"\begin{{tabular}}{{l{'r' * (len(shown) + 1)}}}",
        r"\toprule",
        " & ".join(["variant", r"success [\%]", *(escaped(metric.title) for metric in shown)]) + r" \\",
        r"\midrule",
    ]
    for name, of in runs.items():
        rate, columns = rate_of(of), [values_of(of, metric) for metric in shown]
        first = [escaped(name or "as written"), f"{100 * rate.share:.0f}", *map(_median, columns)]
        second = ["", f"({100 * rate.low:.0f}--{100 * rate.high:.0f})", *map(_quartiles, columns)]
        lines += [" & ".join(first) + r" \\", " & ".join(second) + r" \\"]
    return "\n".join([*lines, r"\bottomrule", r"\end{tabular}", ""])


def escaped(text: str) -> str:
    """Return a text in which LaTeX finds no commands."""
    return "".join(SPECIAL.get(sign, sign) for sign in text)


def _median(values: Sequence[float]) -> str:
    return f"{quartiles_of(values)[1]:.3g}" if values else "--"


def _quartiles(values: Sequence[float]) -> str:
    if not values:
        return ""
    lower, _, upper = quartiles_of(values)
    return f"({lower:.3g}--{upper:.3g})"
