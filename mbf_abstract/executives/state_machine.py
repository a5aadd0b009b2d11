"""A state machine of the same leaves as the trees, run by the same executive; a state may even be a whole tree.

Use it where the order of steps is a plan with loops ("next leg", "try again from here"), a tree where many conditions
watch one activity. It is itself a node: run it with ``TreeExecutive``, cancel it at any moment, or put it into a tree.

Example
-------
>>> machine = StateMachine("fetch", {
...     "plan": State(GetPath(), {Status.SUCCESS: "drive", Status.FAILURE: Status.FAILURE}),
...     "drive": State(ExePath(), {Status.SUCCESS: Status.SUCCESS, ExePathOutcome.COLLISION: "back up",
...                                Status.FAILURE: "plan"}),
...     "back up": State(Recovery("back_up"), {Status.SUCCESS: "drive", Status.FAILURE: Status.FAILURE}),
... })
>>> TreeExecutive(machine, navigator).run(Pose.planar(8.0, 3.0))
"""

from __future__ import annotations

from collections.abc import Generator, Mapping
from dataclasses import dataclass
from typing import Any, TypeAlias

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from mbf_abstract.executives.nodes import Composite

Target: TypeAlias = Any
"""Name of the next state, or the ``Status`` (SUCCESS, FAILURE) the machine ends with."""


@dataclass(frozen=True)
class State:
    """A node and where to go when it has ended.

    Attributes
    ----------
    transitions : mapping
        From ``Status.SUCCESS``, ``Status.FAILURE`` and, before the latter, codes of the mission's last failure.
    """

    node: Behaviour
    transitions: Mapping[Any, Target]


class StateMachine(Composite):
    """Runs one state at a time, beginning with the first.

    Raises
    ------
    ValueError
        A transition leads nowhere, or a state has no transition for its success or failure; all of them at once.
    """

    def __init__(self, name: str, states: Mapping[str, State]) -> None:
        super().__init__(name, [state.node for state in states.values()])
        _check(name, states)
        self.states = dict(states)
        self.state = next(iter(states))

    def initialise(self) -> None:
        """Enter the first state."""
        self.state = next(iter(self.states))

    def tick_children(self) -> Generator[Behaviour, None, Status]:
        """Tick the present state; enter what follows within the same tick, but no state twice in one."""
        visited: set[str] = set()
        while self.state not in visited:
            visited.add(self.state)
            state = self.states[self.state]
            self.feedback_message = self.state
            status = yield from self.tick_child(state.node)
            if status == Status.RUNNING:
                return Status.RUNNING
            target = self._target(state, status)
            if isinstance(target, Status):
                return target
            self.state = target
        return Status.RUNNING

    def _target(self, state: State, status: Status) -> Target:
        if status == Status.FAILURE and self.mission.failure_code in state.transitions:
            return state.transitions[self.mission.failure_code]
        return state.transitions[status]


def _check(name: str, states: Mapping[str, State]) -> None:
    ends = (Status.SUCCESS, Status.FAILURE)
    problems = [
        f"state {key!r} leads to {target!r}, which is not a state"
        for key, state in states.items()
        for target in state.transitions.values()
        if target not in states and target not in ends
    ]
    problems += [
        f"state {key!r} has no transition for {end.value}"
        for key, state in states.items()
        for end in ends
        if end not in state.transitions
    ]
    if not states:
        problems.append("there are no states")
    if problems:
        raise ValueError(f"state machine {name!r}: " + "; ".join(problems))
