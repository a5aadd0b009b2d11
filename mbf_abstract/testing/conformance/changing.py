"""Parameters that change while a goal runs."""

from __future__ import annotations

from mbf_abstract.goals.goal_types import ExePathGoal
from mbf_abstract.outcomes import ExePathOutcome
from mbf_abstract.plugins import PluginKind
from mbf_abstract.server.plugin_host import ServerError
from mbf_abstract.testing.conformance.site import Site, situation


@situation()
def limits_change_while_driving(site: Site) -> None:
    """A limit of the server that changes while the robot drives takes effect at once, and the drive goes on."""
    handle = site.navigator.send(ExePathGoal(site.path((2.0, 4.0), (6.0, 4.0))))
    site.expect_moves(1.0, "before the change")
    site.server.set_parameters(max_vel_x=0.1)
    site.rig.clock.sleep(0.2)
    before = site.rig.robot.pose
    site.rig.clock.sleep(1.0)
    moved = before.distance_to(site.rig.robot.pose)
    site.expect(0.05 < moved < 0.12, f"with max_vel_x 0.1 m/s the robot moved {moved:.2f} m in a second")
    site.server.set_parameters(max_vel_x=None)
    site.expect_outcome(handle.wait(60.0), ExePathOutcome.SUCCESS)


@situation()
def a_bad_change_changes_nothing(site: Site) -> None:
    """A value that is not legal is a ValueError and changes nothing; an unknown plugin is a ServerError."""
    server = site.server
    site.expect_raises(ValueError, lambda: server.set_parameters(controller_frequency=-1.0), "a negative frequency")
    wrong = lambda: server.set_plugin_parameters(PluginKind.RECOVERY, "wait", duration=-1.0)  # noqa: E731
    site.expect_raises(ValueError, wrong, "a negative duration")
    unknown = lambda: server.set_plugin_parameters(PluginKind.RECOVERY, "nobody", duration=1.0)  # noqa: E731
    site.expect_raises(ServerError, unknown, "an unknown recovery")
    site.expect_outcome(site.navigator.exe_path(site.path((2.0, 4.0), (3.0, 4.0))), ExePathOutcome.SUCCESS)
