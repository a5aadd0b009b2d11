"""The contract of refiners."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.geometry import Path
from mbf_abstract.outcomes import RefinePathOutcome
from mbf_abstract.parameters import PluginParameters
from mbf_abstract.plugins import AbstractRefiner, RefineResult
from mbf_abstract.testing.contract.report import Report
from mbf_abstract.testing.contract.rig import (
    ContextMaker,
    canceled_token,
    expect_idle_cancel_is_harmless,
    rig,
    same_context,
)
from mbf_abstract.time.cancel import CancelToken

_SPAN = range(200, 250)


def check_refiner(
    refiner_class: type[AbstractRefiner],
    path: Path,
    *,
    make_context: ContextMaker = same_context,
    parameters: PluginParameters | None = None,
    watched: Sequence[NDArray[Any]] = (),
    end_tolerance: float = 0.1,
) -> None:
    """Check a refiner against the contract.

    Parameters
    ----------
    path : Path
        A path it can refine; shorter parts of it are tried too.
    make_context, parameters, watched
        As for ``check_planner``.
    end_tolerance : float
        How far [m] the ends may move.

    Raises
    ------
    ContractBroken
        With everything that is wrong.
    """
    report = Report(refiner_class, [path.positions, np.asarray(path.orientations), *watched])

    def refine(refiner: AbstractRefiner, situation: str, given: Path, token: CancelToken) -> RefineResult | None:
        def apply() -> RefineResult:
            return refiner.apply_refinement(given, token)

        return report.call(situation, apply, RefineResult, RefinePathOutcome, _SPAN)

    refined: list[Path] = []
    with report.no_exception("construction"):
        for _ in range(2):
            with rig(refiner_class, make_context, parameters, path[0]) as made:
                expect_idle_cancel_is_harmless(report, made.plugin)
                result = refine(made.plugin, "a whole path", path, CancelToken())
                good = result is not None and result.success and result.path is not None and len(result.path) > 0
                report.expect(good, f"a whole path: no refined path ({result})")
                if good and result is not None and result.path is not None:
                    refined.append(result.path)
                for length in (1, 2):
                    refine(made.plugin, f"a path of {length} pose(s)", path[:length], CancelToken())
                stopped = refine(made.plugin, "canceled before", path, canceled_token())
                code = None if stopped is None else stopped.outcome
                ended = code is None or code == RefinePathOutcome.CANCELED
                report.expect(ended, f"canceled before: outcome {code}, expected CANCELED (202)")
    for new in refined:
        report.expect(new.frame_id == path.frame_id, f"the refined path is in frame {new.frame_id!r}")
        for name, gap in (("start", new[0].distance_to(path[0])), ("goal", new[-1].distance_to(path[-1]))):
            report.expect(gap <= end_tolerance, f"the refined path is {gap:.2f} m from the {name}")
    if len(refined) == 2:
        same = np.array_equal(refined[0].positions, refined[1].positions)
        report.expect(same, "two instances with the same seed gave different paths")
    report.finish()
