"""Who came as near as a contact and is not seen any more: they may still be there.

A lidar does not see what is nearer than its least range, nor what lies within the outline of the robot, where points
are filtered. So who walks into a robot that stands is lost while they touch it, and the last that was seen of them, a
part, passes for somebody who leaves. A robot that goes by that sets off into them. So it stands until they were seen
to leave, or for ``lost_contact_time`` after they were last seen as near as that.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from mbf_abstract.geometry import Pose
from mbf_abstract.maps.tracking.objects import TrackedObject
from mbf_abstract.maps.tracking.robot_box import RobotBox

LEFT = 0.3
"""Who is still seen this long [s] after they were last as near as a contact has left."""
OUT_OF_SIGHT = 0.25
"""Who is unseen for this long [s] is out of sight: lidars of 10 Hz have sent two scans by then."""


class LostContacts:
    """Remembers who came near the robot, and when it last saw them."""

    def __init__(self) -> None:
        self._near: dict[int, TrackedObject] = {}  # by number, as last seen there
        self._last_seen: dict[int, float] = {}

    def held(
        self, box: RobotBox, pose: Pose, moving: Sequence[TrackedObject], margin: float, lasting: float, now: float
    ) -> TrackedObject | None:
        """Whom the robot stands for, as it last saw them; None if for nobody.

        Parameters
        ----------
        pose : Pose
            Of the robot, in the frame of the objects.
        moving : sequence of TrackedObject
            Those that move now.
        margin : float
            Who is within it [m] is as near as a contact.
        lasting : float
            How long [s] somebody counts who is out of sight; 0 = nobody does.
        now : float
            [s]
        """
        self._look(box, pose, moving, margin, now)
        for number, known in list(self._near.items()):
            seen = self._last_seen[number]
            if now - known.stamp >= lasting or seen - known.stamp >= LEFT:
                del self._near[number], self._last_seen[number]
            elif now - seen > OUT_OF_SIGHT:
                return known
        return None

    def _look(self, box: RobotBox, pose: Pose, moving: Sequence[TrackedObject], margin: float, now: float) -> None:
        """Take in where each of those who move was when it was last seen."""
        if not moving:
            return
        seen = [_when_seen(known, now) for known in moving]
        places, radii = np.array([[(one.x, one.y) for one in seen]]), np.array([one.radius for one in seen])
        gaps = box.gaps(np.array([(pose.x, pose.y, pose.yaw)]), places, radii)[0]
        for known, gap in zip(seen, gaps.tolist(), strict=True):
            if gap < margin:
                self._near[known.number] = known
            if known.number in self._near:
                self._last_seen[known.number] = known.stamp


def _when_seen(known: TrackedObject, now: float) -> TrackedObject:
    """The object where it was when it was last seen, stamped with that time."""
    x, y = known.position_in(-known.unseen)
    return replace(known, x=x, y=y, stamp=now - known.unseen)
