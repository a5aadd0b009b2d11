"""Recoveries that move the robot end with the same outcome in the same situation, whatever the map."""

import numpy as np
import pytest

from mbf_abstract.config.registry import PluginRegistry
from mbf_abstract.geometry import Pose, Twist
from mbf_abstract.outcomes import RecoveryOutcome
from mbf_abstract.plugins import PluginKind, RecoveryRequest
from mbf_abstract.testing.contract.recovery import RigMotion
from mbf_abstract.testing.contract.rig import rig
from mbf_abstract.time.cancel import CancelToken
from mbf_costmap_nav.map.costmap_config import CostmapParameters, build_layered_costmap
from mbf_costmap_nav.plugins import CostmapContext
from mbf_mesh_nav.layers.obstacle import ObstacleLayer
from mbf_mesh_nav.map.layer import LayerContext
from mbf_mesh_nav.map.layer_graph import LayerGraph
from mbf_mesh_nav.map.mesh_map import MeshMap
from mbf_mesh_nav.plugins import MeshContext

START = Pose.planar(3.0, 3.0)
RECOVERIES = [(backend, name) for backend in ("costmap", "mesh") for name in ("back_up", "rotate")]


class StuckMotion(RigMotion):
    """Takes commands, but the wheels do not turn."""

    def send(self, command):
        self.commands.append(command)
        return True


class PausedMotion(RigMotion):
    """Refuses the first command, as the motion of a goal that is paused for a while does."""

    refused = False

    def send(self, command):
        if not self.refused:
            self.refused = True
            return False
        return super().send(command)


def stale_costmap(base):
    costmap = build_layered_costmap(CostmapParameters(resolution=0.05, robot_radius=0.2, max_age=0.5))
    costmap.update(START, -1.0)
    return CostmapContext(**vars(base), global_costmap=costmap, local_costmap=costmap, costmap=costmap)


def stale_mesh(base):
    mesh_map = MeshMap.from_heights(np.zeros((61, 81)), 0.1, 0.1)
    parameters = ObstacleLayer.Parameters(expected_update_rate=0.5)
    layer = ObstacleLayer(LayerContext("obstacle", mesh_map.topology, mesh_map.locator, parameters))
    layer.recompute()
    mesh_map.set_layers(LayerGraph([layer]), "obstacle", 0.0)
    return MeshContext(**vars(base), mesh_map=mesh_map)


STALE = {"costmap": stale_costmap, "mesh": stale_mesh}


@pytest.fixture(params=RECOVERIES, ids=".".join)
def run(request):
    """``run(motion_class, stale=..., lost=..., closed=..., cancel=...)`` -> (result, commands)."""
    backend, name = request.param
    recovery_class = PluginRegistry(backend).load(PluginKind.RECOVERY, name)
    site = request.getfixturevalue(f"{backend}_site")

    def run_it(motion_class=RigMotion, stale=False, cancel="", **state):
        make_context, parameters = (
            STALE[backend] if stale else site.make_context,
            recovery_class.Parameters(time_limit=1),
        )
        with rig(recovery_class, make_context, parameters, START) as made:
            token = CancelToken()
            motion = motion_class(made, token, lambda pose: pose)
            vars(motion).update(state)
            if cancel:
                made.clock.spawn(lambda: (made.clock.sleep(0.3), token.cancel(cancel)), "canceler")
            result = made.plugin.run_behavior(RecoveryRequest(motion, token))
            assert made.robot.command.is_stopped()
            return result, motion.commands

    return run_it


def test_time_over_is_pat_exceeded(run):
    result, commands = run(StuckMotion)
    assert result.outcome == RecoveryOutcome.PAT_EXCEEDED
    assert "not done after 1 s" in result.message
    assert not commands[0].is_stopped() and commands[-1] == Twist()


def test_a_gate_that_refuses_is_stopped(run):
    result, _ = run(closed=True)
    assert result.outcome == RecoveryOutcome.STOPPED
    assert "the velocity gate refused the command" in result.message


def test_a_refusal_for_the_time_of_a_pause_is_no_end(run):
    result, commands = run(PausedMotion)
    assert result.outcome == RecoveryOutcome.PAT_EXCEEDED, "it drives on until its second is over"
    assert not commands[0].is_stopped()


def test_a_cancel_is_canceled_with_its_reason(run):
    result, _ = run(StuckMotion, cancel="enough of this")
    assert result.outcome == RecoveryOutcome.CANCELED
    assert "enough of this" in result.message


def test_a_lost_robot_is_a_tf_error(run):
    result, _ = run(lost=True)
    assert result.outcome == RecoveryOutcome.TF_ERROR


def test_the_robot_stands_while_the_map_is_stale_and_the_reason_is_said(run):
    result, commands = run(stale=True)
    assert result.outcome == RecoveryOutcome.PAT_EXCEEDED
    assert (
        "old, allowed are" in result.message
        or "has not sent" in result.message
        or "no observation source" in result.message
    )
    assert len(commands) > 1 and all(command.is_stopped() for command in commands)
