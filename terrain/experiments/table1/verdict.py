"""Whether the paper's result is reproduced, by six rules that were fixed before any run of the main seeds.

The rules are those of section 6.5 of the benchmark notes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from terrain.experiments.table1.counting import Tally
from terrain.experiments.table1.statistics import clear_share, compare, entropy, recovery_mix

SAFETY_SLACK = 1  # contacts, and lost legs, that condition B may have more than condition A


@dataclass(frozen=True)
class Criterion:
    """One claim: what was found, whether its direction holds, and whether the agreement is strong."""

    claim: str
    found: str
    holds: bool
    strong: bool


def judge(a: Sequence[Tally], b: Sequence[Tally]) -> list[Criterion]:
    """Apply the six rules to paired tallies."""
    ratios = compare(a, b)
    planner, controller = ratios["planner calls"], ratios["controller calls"]
    recoveries, time = ratios["recovery calls"].value, ratios["time"]
    saving = tuple(100.0 * (1.0 / value - 1.0) for value in (time.value, time.low, time.high))
    return [
        Criterion(
            "fewer planner calls (paper 4.12)",
            f"{planner.value:.2f} [{planner.low:.2f}, {planner.high:.2f}]",
            planner.value >= 2.0 and planner.low > 1.0,
            3.0 <= planner.value <= 6.0,
        ),
        Criterion(
            "fewer controller calls (1.68)",
            f"{controller.value:.2f} [{controller.low:.2f}, {controller.high:.2f}]",
            controller.low > 1.0 and controller.value > 1.0,
            1.3 <= controller.value <= 2.2,
        ),
        Criterion(
            "recovery total about equal (1.08)", f"{recoveries:.2f}", 0.7 <= recoveries <= 1.5, 0.8 <= recoveries <= 1.3
        ),
        _judge_mix(a, b),
        Criterion(
            "less time (-12.5 %)",
            f"{saving[0]:+.1f} % [{saving[2]:+.1f}, {saving[1]:+.1f}]",
            time.value > 1.0 and time.low > 1.0,
            -20.0 <= saving[0] <= -5.0,
        ),
        _judge_safety(a, b),
    ]


def _judge_mix(a: Sequence[Tally], b: Sequence[Tally]) -> Criterion:
    mix_a, mix_b = recovery_mix(a), recovery_mix(b)
    bits_a, bits_b = entropy(mix_a), entropy(mix_b)
    share_a, share_b = clear_share(mix_a), clear_share(mix_b)
    return Criterion(
        "mix more homogeneous (0.65 -> 1.66 bit, clear 90 -> 52 %)",
        f"{bits_a:.2f} -> {bits_b:.2f} bit, clear {100.0 * share_a:.0f} -> {100.0 * share_b:.0f} %",
        bits_b > bits_a and share_b < share_a,
        share_a - share_b >= 0.2,
    )


def _judge_safety(a: Sequence[Tally], b: Sequence[Tally]) -> Criterion:
    contacts = [sum(tally.all_contacts for tally in tallies) for tallies in (a, b)]
    lost = [sum(tally.legs_lost for tally in tallies) for tallies in (a, b)]
    return Criterion(
        "no loss of safety",
        f"contacts {contacts[0]} -> {contacts[1]}, lost legs {lost[0]} -> {lost[1]}",
        contacts[1] <= contacts[0] + SAFETY_SLACK and lost[1] <= lost[0] + SAFETY_SLACK,
        contacts[1] <= contacts[0] and lost[1] <= lost[0],
    )


def verdict(criteria: Sequence[Criterion], planner_ratio: float) -> str:
    """``reproduced``, ``partly reproduced`` or ``not reproduced``.

    Not reproduced: the planner ratio is below 2, or safety was lost. Partly: planner calls and mix hold, something
    else does not. Where even the mix does not hold there is nothing left to call partly reproduced.
    """
    holds = [criterion.holds for criterion in criteria]
    if all(holds):
        return "reproduced"
    planner, _, _, mix, _, safety = holds
    if planner_ratio < 2.0 or not safety:
        return "not reproduced"
    return "partly reproduced" if planner and mix else "not reproduced"
