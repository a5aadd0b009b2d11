"""What a tree does with a robot that is stuck: the behaviours of ``escalation_behaviors``, one after the other.

``Escalation`` holds a task with its usual recoveries. Where the same failure comes again and again at one place, or the
task fails for good, it runs the next behaviour of the escalation and the task from its beginning. Each behaviour runs
once at a place; then the mission fails, with a message that names the place and what was tried there.

Where the task is blocked by robots that announce their ways, ``right_of_way_behavior`` runs at the first failure,
before the recoveries inside the task.

Both are parameters of the server, so that ``move_base`` and all trees share them. Without them the node does what its
task does; only the message of a robot that is stuck says more.
"""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import replace
from typing import Any

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from mbf_abstract.executives.conditions import recovery_would_help
from mbf_abstract.executives.leaves import Recovery
from mbf_abstract.executives.nodes import Composite
from mbf_abstract.executives.recovering import TaskWithRecoveries


class NextBehavior(Recovery):
    """Run the behaviour that the escalation has chosen."""

    def __init__(self, name: str) -> None:
        super().__init__("", name)


class Escalation(Composite):
    """Run a task; where it fails or the robot is stuck, run the next behaviour that is due, then the task anew.

    How a behaviour ended does not matter: the task decides.
    """

    def __init__(self, name: str, task: Behaviour) -> None:
        self._behavior = NextBehavior("escalate")
        super().__init__(name, [task, self._behavior])

    def setup(self, **kwargs: Any) -> None:
        """Let the recoveries inside the task give up where a behaviour is due that the stuck monitor decides on."""
        super().setup(**kwargs)
        for node in self.children[0].iterate():
            if isinstance(node, TaskWithRecoveries):
                node.gives_up = self._is_due

    def initialise(self) -> None:
        """Begin with the task; nothing has failed yet."""
        self.mission.stuck.restart(self.mission.navigator.server.runtime.parameters.escalation_behaviors)
        self._escalating = False

    def tick_children(self) -> Generator[Behaviour, None, Status]:
        """Go on with the task or the behaviour that is running."""
        task, behavior = self.children
        while True:
            if self._escalating:
                if (yield from self.tick_child(behavior)) == Status.RUNNING:
                    return Status.RUNNING
                self._escalating = False
            status = yield from self.tick_child(task)
            if status != Status.FAILURE or not recovery_would_help(self.mission.failure_code):
                return status
            self._behavior.behavior = self.mission.stuck.next_behavior()
            if not self._behavior.behavior:
                return self._give_up()
            self.feedback_message = self._behavior.behavior
            self._escalating = True

    def _is_due(self) -> bool:
        return self.mission.stuck.escalates

    def _give_up(self) -> Status:
        """Say in the mission's failure where the robot is stuck and what was tried."""
        failure = self.mission.failure
        assert failure is not None  # its code was looked at
        self.mission.failure = replace(failure, message=self.mission.stuck.described(failure.message))
        self.feedback_message = self.mission.failure.message
        return Status.FAILURE
