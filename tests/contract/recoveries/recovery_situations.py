"""Maps and motions in which recoveries are run."""

import numpy as np

from mbf_abstract.geometry import Pose
from mbf_abstract.testing.contract.recovery import RigMotion

START = Pose.planar(3.0, 3.0)
MOVING = ["back_up", "drive_on_heading", "give_way", "move_away", "rotate"]
PARAMETERS = {"move_away": {"clearance": 2.0}, "give_way": {"wait": 0.2, "random_extra": 0.0}}


def nothing(x, y):
    return np.zeros_like(x, dtype=bool)


def everything(x, y):
    return np.ones_like(x, dtype=bool)


def before_the_wall(x, y):
    """Lethal from x = 4.5 on."""
    return x > 4.5


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
