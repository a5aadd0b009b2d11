"""One recovery, run on a map of either kind."""

import pytest

from mbf_abstract.config.registry import PluginRegistry
from mbf_abstract.plugins import PluginKind, RecoveryRequest
from mbf_abstract.testing.contract.recovery import RigMotion
from mbf_abstract.testing.contract.rig import rig
from mbf_abstract.time.cancel import CancelToken
from tests.contract.recoveries.recovery_situations import PARAMETERS, START


@pytest.fixture
def run(world):
    """``run(name, map, motion_class, start=.., cancel=.., lost=.., closed=.., **parameters)`` -> result, its motion."""

    def run_it(name, navigation_map, motion_class=RigMotion, start=START, cancel=None, **options):
        recovery_class = PluginRegistry(world.backend).load(PluginKind.RECOVERY, name)
        state = {key: options.pop(key) for key in ("lost", "closed") if key in options}
        parameters = recovery_class.Parameters(**{**PARAMETERS.get(name, {}), **options})

        def make_context(base):
            return world.context(**vars(base), navigation_map=navigation_map)

        with rig(recovery_class, make_context, parameters, start) as made:
            token = CancelToken()
            motion = motion_class(made, token, lambda pose: pose)
            vars(motion).update(state)
            motion.plugin, motion.seconds = made.plugin, 0.0
            if cancel == 0.0:
                token.cancel("enough of this")
            elif cancel:
                made.clock.spawn(lambda: (made.clock.sleep(cancel), token.cancel("enough of this")), "canceler")
            result = made.plugin.run_behavior(RecoveryRequest(motion, token))
            assert made.robot.command.is_stopped()
            motion.end, motion.seconds = made.robot.pose, made.clock.now()
            return result, motion

    return run_it
