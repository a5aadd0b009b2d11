"""What a plugin may answer, and the faults of one that answers something else or raises."""

from __future__ import annotations

import copy
import math
import numbers
from typing import TypeVar

import numpy as np

from mbf_abstract.drive.commands import command_problem
from mbf_abstract.geometry import AckermannCommand, Path, Twist
from mbf_abstract.outcomes import outcome_name
from mbf_abstract.plugins import PluginResult

MAX_OUTCOME = 2**32 - 1  # outcomes are unsigned integers of 32 bits in ``mbf_msgs``

A = TypeVar("A", bound=PluginResult)


class PluginFault(Exception):
    """A plugin raised, or returned something that is no result; the text names plugin, type and message."""


class PluginNonFinite(PluginFault):
    """A plugin made a pose, path or command that is not finite."""


def checked_answer(answer: object, expected: type[A], plugin: str, method: str) -> A:
    """Return a plugin's answer if it is a result that can be passed on; raises PluginFault if it is not.

    A wrong type is a fault of the plugin that calling it again cannot change. A command of the right type that is not
    finite raises PluginNonFinite: the next one may be finite. A failure without a text gets one that names the plugin.
    """
    if not isinstance(answer, expected):
        raise PluginFault(f"plugin {plugin!r} returned {type(answer).__name__} from {method}, not {expected.__name__}")
    outcome: object = answer.outcome
    message: object = answer.message
    problem = ""
    if isinstance(outcome, bool) or not isinstance(outcome, numbers.Integral):
        problem = f"an outcome of type {type(outcome).__name__}, not an integer"
    elif not 0 <= int(outcome) <= MAX_OUTCOME:
        problem = f"an outcome outside of 0..{MAX_OUTCOME}"  # may have too many digits to be printed
    elif not isinstance(message, str):
        problem = f"a message of type {type(message).__name__}, not str"
    else:
        problem = _wrong_plan(answer) or _wrong_command(answer)
    if problem:
        raise PluginFault(f"plugin {plugin!r} returned {problem}, from {method}")
    if (command := getattr(answer, "command", None)) is not None and (not_finite := command_problem(command)):
        raise PluginNonFinite(f"plugin {plugin!r}: {not_finite}, from {method}")
    if not (answer.message or answer.success):
        name = outcome_name(answer.outcome)
        answer = copy.copy(answer)  # the plugin may keep its own, which is frozen
        object.__setattr__(answer, "message", f"plugin {plugin!r} failed with {name} and gave no reason")
    return answer


def checked_flag(answer: object, plugin: str, method: str) -> bool:
    """Return a plugin's yes or no; raises PluginFault for anything else, such as the None of a forgotten return."""
    if not isinstance(answer, bool | np.bool_):
        raise PluginFault(f"plugin {plugin!r} returned {type(answer).__name__} from {method}, not bool")
    return bool(answer)


def _wrong_plan(answer: PluginResult) -> str:
    """What is wrong with the path and the cost of an answer that has them; empty if nothing is."""
    path: object = getattr(answer, "path", None)
    cost: object = getattr(answer, "cost", 0.0)
    if path is not None and not isinstance(path, Path):
        return f"a path of type {type(path).__name__}, not Path"
    if isinstance(cost, bool) or not isinstance(cost, numbers.Real):
        return f"a cost of type {type(cost).__name__}, not a number"
    return "a cost of nan, which is no number" if math.isnan(cost) else ""


def _wrong_command(answer: PluginResult) -> str:
    """What is wrong with the types of a controller's answer; empty if nothing is."""
    command: object = getattr(answer, "command", None)
    hindered_by: object = getattr(answer, "hindered_by", "")
    if command is not None and type(command) not in (Twist, AckermannCommand):  # nor a subclass, see command_problem
        return f"a command of type {type(command).__name__}, not Twist or AckermannCommand"
    if not isinstance(hindered_by, str):
        return f"a hindered_by of type {type(hindered_by).__name__}, not str"
    return ""
