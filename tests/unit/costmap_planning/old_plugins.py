"""Plugins written the nav_core way, for the test of the wrappers."""

from mbf_abstract.geometry import Pose, Twist
from mbf_abstract.server.nav_core import BaseGlobalPlanner, BaseLocalPlanner, RecoveryBehavior


class OldPlanner(BaseGlobalPlanner):
    """Goes straight to the right, gives up on the left."""

    def initialize(self, name, costmap):
        self.costmap = costmap

    def make_plan(self, start, goal):
        return [start, goal] if goal.x > start.x else None


class OldController(BaseLocalPlanner):
    """Drives forward until it is past the goal; asks for the pose itself."""

    def initialize(self, name, transforms, costmap):
        self.robot = transforms

    def set_plan(self, plan):
        self.goal = plan[-1]
        return isinstance(self.goal, Pose)

    def compute_velocity_commands(self):
        return Twist.planar(0.5) if self.goal.x < 100.0 else None

    def is_goal_reached(self):
        return self.robot.pose().x >= self.goal.x


class OldRecovery(RecoveryBehavior):
    """Clears both maps."""

    def initialize(self, name, transforms, global_costmap, local_costmap):
        self.maps = (global_costmap, local_costmap)

    def run_behavior(self):
        for costmap in self.maps:
            costmap.clear()
