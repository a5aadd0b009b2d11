"""Checks a robot's driver before the first goal, so that a wrong one is refused before the robot moves."""

from __future__ import annotations

import inspect
import math
from numbers import Real

from mbf_abstract.drive.robot import Odometry, Robot, odometry_problem
from mbf_abstract.geometry import Twist
from mbf_abstract.time.clock import Clock

FIRST_ANSWER_WITHIN = 1.0  # s
METHODS = {"send_command": 1, "odometry": 0}


class DriverError(TypeError):
    """An object that is no robot driver; the text names the method, what was expected and what came."""


def check_driver(robot: Robot, clock: Clock) -> None:
    """Refuse an object that does not have the two methods of ``Robot``, or whose odometry has a wrong type.

    The first odometry is asked for on a thread of its own, so that one that blocks does not block its caller. A driver
    that raises, or does not answer yet, may still connect later and is accepted.

    Raises
    ------
    DriverError
        The object is a class, a method is missing, a coroutine function or takes other arguments, ``odometry``
        answers with something else than ``Odometry`` or None, or ``min_turning_radius`` is no length.
    """
    name = robot.__name__ if isinstance(robot, type) else type(robot).__name__
    if isinstance(robot, type):
        raise DriverError(f"the robot must be a driver object, got the class {name}")
    for method, arguments in METHODS.items():
        problem = _method_problem(getattr(robot, method, None), arguments)
        if problem:
            raise DriverError(f"{name} is not a robot driver: {method} {problem}")
    radius = getattr(robot, "min_turning_radius", 0.0)
    if not isinstance(radius, Real) or not 0.0 <= float(radius) < math.inf:
        raise DriverError(f"{name} is not a robot driver: min_turning_radius is {radius!r}, expected a length in m")
    problem = _first_odometry_problem(robot, clock)
    if problem:
        raise DriverError(f"{name} is not a robot driver: {problem}")


def _method_problem(method: object, arguments: int) -> str:
    if not callable(method):
        return "is missing" if method is None else f"is {type(method).__name__}, expected a method"
    if inspect.iscoroutinefunction(method) or inspect.isasyncgenfunction(method):
        return "is a coroutine function; it is called from plain threads and must be a plain function"
    try:
        inspect.signature(method).bind(*[None] * arguments)
    except TypeError:
        return f"must take {arguments} argument(s), but its signature is {inspect.signature(method)}"
    except ValueError:  # a function of an extension module without a readable signature
        return ""
    return ""


def _first_odometry_problem(robot: Robot, clock: Clock) -> str:
    problems: list[str] = []

    def ask() -> None:
        try:
            with clock.guarded("robot.odometry"):
                answer: object = robot.odometry()
        except BaseException:
            return
        if inspect.iscoroutine(answer):
            answer.close()
        if answer is None or (isinstance(answer, Odometry) and isinstance(answer.velocity, Twist)):
            return  # its numbers are looked at each time it is asked
        problems.append(odometry_problem(answer))

    clock.spawn(ask, "first odometry").join(FIRST_ANSWER_WITHIN)
    return problems[0] if problems else ""
