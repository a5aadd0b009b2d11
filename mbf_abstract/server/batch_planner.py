"""Plans between many pairs of poses, on all processors: for evaluations, and for the legs of a whole fleet.

When to use: hundreds of plans on one map. When not: for the next path of one robot; the action ``get_path`` has
patience, retries, a fallback planner and events, and none of them is here.

Planners spend their time in kernels that release the interpreter's lock, so threads share one map and copy nothing.
Each thread has an instance of the planner of its own. A planner written in plain Python gains nothing, nor does one on
a map of tiles, where one search runs at a time.

Example
-------
>>> batch = BatchPlanner(navigator.server, "astar")
>>> lengths = [plan.path.length for plan in batch.plan_many(starts, goals) if plan.success]
"""

from __future__ import annotations

import os
import threading
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

from mbf_abstract.event_values import error_text
from mbf_abstract.execution.plan_check import in_global_frame, path_result
from mbf_abstract.execution.plugin_answer import PluginFault, checked_answer
from mbf_abstract.geometry import Pose
from mbf_abstract.geometry.transform import TransformError
from mbf_abstract.goals.arrival_tolerance import plan_tolerance_problem
from mbf_abstract.goals.result_types import GetPathResult
from mbf_abstract.outcomes import GetPathOutcome
from mbf_abstract.plugins import AbstractPlanner, PlanRequest, PlanResult, PluginKind
from mbf_abstract.server.navigation_server import AbstractNavigationServer
from mbf_abstract.server.plugin_host import ServerError
from mbf_abstract.time.cancel import CancelToken

Pair = tuple[Pose, Pose]


class BatchPlanner:
    """Instances of one planner, one a thread; they keep from call to call what they have found out about the map.

    Parameters
    ----------
    server : AbstractNavigationServer
        Whose map and planner are used. Goals may run beside a batch.
    planner : str
        Name of a loaded planner, whose parameters are taken over as they are now; the first one if empty.
    workers : int, optional
        Number of threads; one a processor if not given.

    Raises
    ------
    ServerError
        There is no such planner, or it can not be used, or a goal is using it right now.
    ValueError
        There is no worker.
    """

    def __init__(self, server: AbstractNavigationServer, planner: str = "", workers: int | None = None) -> None:
        workers = (os.cpu_count() or 1) if workers is None else workers
        if workers < 1:
            raise ValueError(f"at least one worker is needed, got {workers}")
        if problem := server.plugins.problem(PluginKind.PLANNER, planner):
            raise ServerError(problem)
        name = server.plugins.get(PluginKind.PLANNER, planner).name
        self._server = server
        self._busy = threading.Lock()
        self._planners = [server.further_instance(PluginKind.PLANNER, name) for _ in range(workers)]

    def plan_many(
        self,
        starts: Sequence[Pose],
        goals: Sequence[Pose],
        *,
        dist_tolerance: float | None = None,
        angle_tolerance: float | None = None,
        cancel_token: CancelToken | None = None,
    ) -> list[GetPathResult]:
        """Plan from every start to the goal of the same index; one call at a time.

        The result of a pair is that of one call of the planner, checked as ``get_path`` checks it. It does not depend
        on the number of workers as long as the planner's answers do not depend on what it was asked before, which
        holds for all that are shipped for costmaps and meshes. What sensors see meanwhile is in the later plans only.

        Parameters
        ----------
        starts, goals : sequences of Pose
            Of the same length n, in any frame that the server knows.
        dist_tolerance, angle_tolerance : float, optional
            How far [m], [rad] from its goal a path may end; the server's parameters if not given.
        cancel_token : CancelToken, optional
            Once it is set, the pairs that are left end with CANCELED, and those being planned if their planner looks.

        Returns
        -------
        list of n GetPathResult
            In the order of the pairs. What goes wrong with one pair is its own outcome: TF_ERROR where a pose cannot be
            transformed to the global frame, INTERNAL_ERROR with what a planner, or the map, raises.

        Raises
        ------
        ServerError
            Another thread is in this method.
        TypeError
            A start or goal is no pose.
        ValueError
            Not as many starts as goals, or a tolerance that a ``GetPathGoal`` may not have.
        """
        pairs, parameters = _checked_pairs(starts, goals), self._server.runtime.parameters
        distance = parameters.dist_tolerance if dist_tolerance is None else dist_tolerance
        angle = parameters.angle_tolerance if angle_tolerance is None else angle_tolerance
        if problem := plan_tolerance_problem(distance, angle):
            raise ValueError(problem)
        token = cancel_token or CancelToken()
        if not self._busy.acquire(blocking=False):
            raise ServerError("this batch planner is in use by another thread; make one for each")
        try:
            return self._plan(pairs, _PairPlan(self._server, distance, angle, token)) if pairs else []
        finally:
            self._busy.release()

    def _plan(self, pairs: list[Pair], plan: _PairPlan) -> list[GetPathResult]:
        """Hand the pairs out to the threads, one by one."""
        results: dict[int, GetPathResult] = {}
        indices = iter(_order(pairs))  # of a list, so its next() is atomic

        def work(planner: AbstractPlanner) -> None:
            for index in indices:
                results[index] = plan.result(planner, pairs[index])

        planners = self._planners[: len(pairs)]
        with self._server.using_map(PluginKind.PLANNER), ThreadPoolExecutor(len(planners), "plan_many") as pool:
            try:
                for done in [pool.submit(work, planner) for planner in planners]:
                    done.result()
            except BaseException:  # a Ctrl-C: the pool waits for its threads
                plan.token.cancel("interrupted")
                raise
        return [results[index] for index in range(len(pairs))]


def _checked_pairs(starts: Sequence[Pose], goals: Sequence[Pose]) -> list[Pair]:
    if len(starts) != len(goals):
        raise ValueError(f"as many starts as goals are needed, got {len(starts)} and {len(goals)}")
    for name, poses in (("starts", starts), ("goals", goals)):
        for index, pose in enumerate(poses):
            if not isinstance(pose, Pose):
                raise TypeError(f"{name}[{index}] must be a Pose, got {type(pose).__name__}")
    return list(zip(starts, goals, strict=True))


def _order(pairs: list[Pair]) -> list[int]:
    """Indices of the pairs: far ones first, so that no thread is left with a long plan, but a near one after every two.

    Much of a short plan is Python, for which threads wait for each other: two of them at a time gain next to nothing.
    """
    far_first = sorted(range(len(pairs)), key=lambda index: -pairs[index][0].distance_to(pairs[index][1]))
    count = len(pairs) - len(pairs) // 3
    far, near = far_first[:count], far_first[count:]
    return [index for i in range(0, count, 2) for index in (*far[i : i + 2], *near[i // 2 : i // 2 + 1])]


@dataclass(frozen=True)
class _PairPlan:
    """What the plans of all pairs have in common."""

    server: AbstractNavigationServer
    dist_tolerance: float
    angle_tolerance: float
    token: CancelToken

    def result(self, planner: AbstractPlanner, pair: Pair) -> GetPathResult:
        """The plan of a pair; whatever goes wrong with it is its outcome, as the other pairs go on."""
        try:
            return self._planned(planner, pair)
        except BaseException as error:  # also a sys.exit(); a Ctrl-C comes to the main thread only
            text = f"planning this pair raised {type(error).__name__}: {error_text(error)}"
            return GetPathResult(GetPathOutcome.INTERNAL_ERROR, text, planner=planner.name)

    def _planned(self, planner: AbstractPlanner, pair: Pair) -> GetPathResult:
        runtime, tolerances = self.server.runtime, (self.dist_tolerance, self.angle_tolerance)
        try:
            start, goal = (in_global_frame(pose, runtime) for pose in pair)
        except TransformError as error:
            return GetPathResult(GetPathOutcome.TF_ERROR, str(error), planner=planner.name)
        request = PlanRequest(start, goal, *tolerances, cancel_token=self.token)
        missing = self.server.missing_floor()
        answer = PlanResult(GetPathOutcome.MAP_ERROR, missing, permanent=True) if missing else _ask(planner, request)
        return path_result(answer, answer, request, runtime, planner.name)


def _ask(planner: AbstractPlanner, request: PlanRequest) -> PlanResult:
    """Call a planner once; a cancel before the call and an exception are answers, too."""
    if request.cancel_token.cancelled:
        return PlanResult(GetPathOutcome.CANCELED, request.cancel_token.reason)
    try:
        return checked_answer(planner.make_plan(request), PlanResult, planner.name, "make_plan")
    except PluginFault as fault:
        text = str(fault)
    except BaseException as error:
        text = f"plugin {planner.name!r} raised {type(error).__name__} in make_plan: {error_text(error)}"
    return PlanResult(GetPathOutcome.INTERNAL_ERROR, text)
