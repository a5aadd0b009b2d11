"""Stand still for a while, e.g. until a person has passed.

When to use: first in the list, before anything that moves or forgets. When not: static trouble; it only costs time.
"""

from __future__ import annotations

from typing import ClassVar

from mbf_abstract.geometry import Twist
from mbf_abstract.outcomes import RecoveryOutcome
from mbf_abstract.parameters import PluginParameters, parameter
from mbf_abstract.plugins import RecoveryRequest, RecoveryResult
from mbf_costmap_nav.plugins import CostmapRecovery


class WaitParameters(PluginParameters):
    """Parameters of ``costmap.wait``."""

    duration: float = parameter(3.0, "How long to stand.", unit="s", ge=0.0, le=600.0)


class WaitRecovery(CostmapRecovery):
    """Stops the robot and waits."""

    Parameters: ClassVar[type[PluginParameters]] = WaitParameters
    parameters: WaitParameters

    def run_behavior(self, request: RecoveryRequest) -> RecoveryResult:
        """Wait; ends early when cancelled."""
        request.motion.send(Twist())
        if request.cancel_token.cancelled or not request.motion.sleep(self.parameters.duration):
            return RecoveryResult(RecoveryOutcome.CANCELED, request.cancel_token.reason)
        return RecoveryResult(RecoveryOutcome.SUCCESS, f"waited {self.parameters.duration:g} s")
