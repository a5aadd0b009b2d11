"""Stand still for a while, e.g. until a person has passed.

With ``random_extra`` the time is drawn anew for each run, so that two robots that wait for each other do not start
again at the same moment for ever. The draws come from the plugin's generator: the same seed waits the same times.

When to use: first in the list, before anything that moves or clears. When not: obstacles that stay; it only costs time.
"""

from __future__ import annotations

from typing import ClassVar

from mbf_abstract.geometry import Twist
from mbf_abstract.maps.guarded_motion import GATE_REFUSED, ended_by_others
from mbf_abstract.outcomes import RecoveryOutcome
from mbf_abstract.parameters import PluginParameters, parameter
from mbf_abstract.plugins import AbstractRecovery, RecoveryRequest, RecoveryResult

PERIOD = 0.05  # s


class WaitParameters(PluginParameters):
    """Parameters of ``wait``."""

    duration: float = parameter(3.0, "How long to stand, at least.", unit="s", ge=0.0, le=600.0)
    random_extra: float = parameter(0.0, "Stand up to this much longer, by chance.", unit="s", ge=0.0, le=600.0)


class WaitRecovery(AbstractRecovery):
    """Stops the robot and waits; needs no map and no pose."""

    Parameters: ClassVar[type[PluginParameters]] = WaitParameters
    parameters: WaitParameters

    def run_behavior(self, request: RecoveryRequest) -> RecoveryResult:
        """Wait; ends early when cancelled, or where something else drives the robot."""
        extra = self.parameters.random_extra
        return stand(request, self.parameters.duration + (extra * float(self.rng.random()) if extra > 0.0 else 0.0))


def stand(request: RecoveryRequest, duration: float) -> RecoveryResult:
    """Stop the robot and let it stand for a time [s]; part of other behaviours, too."""
    motion, token = request.motion, request.cancel_token
    if token.cancelled:
        return RecoveryResult(RecoveryOutcome.CANCELED, token.reason)
    # A goal that is paused is refused too: its sleep lasts until it is resumed, so the second refusal counts.
    stands = motion.send(Twist()) or (motion.sleep(PERIOD) and motion.send(Twist()))
    if not stands and not token.cancelled:
        return RecoveryResult(RecoveryOutcome.STOPPED, GATE_REFUSED)
    if not motion.sleep(duration):
        return ended_by_others(token)
    return RecoveryResult(RecoveryOutcome.SUCCESS, f"waited {duration:.3g} s")
