"""What a controller keeps of an old path where a new one begins along it.

When to use: in ``set_plan`` of controllers with ``room_to_turn`` and ``tight_places``. ``move_base`` plans anew while
the robot drives, up to several times a second. A robot that turns to its path, or makes room for a turn, needs longer
than that; if it forgot what it does, it would turn back to the point farther ahead with every plan, or drive on without
end. When not: a path that leads elsewhere, such as to another goal or in the other gear; that one is begun anew.
"""

from __future__ import annotations

import math
from copy import copy

from mbf_abstract.execution.path_tracker import SAME_PLACE, PathTracker
from mbf_abstract.geometry import normalize_angle
from mbf_abstract.maps.controllers.room_to_turn import LOOKS_ALONG, RoomToTurn
from mbf_abstract.maps.controllers.tight_places import TightPlaces

ARM = 0.2
"""Both paths lead the same way if they do so over this length [m] from the robot on."""


def carried_over(
    room_to_turn: RoomToTurn, tight_places: TightPlaces, old: PathTracker | None, new: PathTracker | None
) -> tuple[RoomToTurn, TightPlaces]:
    """What was known of the old path, on the new one; nothing where that does not begin along the old one."""
    shift = None if old is None or new is None else shift_between(old, new)
    if shift is None or new is None:
        return RoomToTurn(), TightPlaces()
    return room_to_turn.shifted(shift), tight_places.shifted(shift, new)


def shift_between(old: PathTracker, new: PathTracker) -> float | None:
    """What a length [m] along the new path has more than along the old one, at the robot; None = they lead apart."""
    if old.path.frame_id != new.path.frame_id or old.length == 0.0 or new.length == 0.0:
        return None
    joined, here = copy(new), old.point_at(old.progress)
    joined.update(here)
    if joined.deviation > SAME_PLACE or joined.driving_backward != old.driving_backward:
        return None
    (x, y), (along_x, along_y) = (_direction(one) for one in (old, joined))
    turn = math.atan2(along_y, along_x) - math.atan2(y, x)
    return joined.progress - old.progress if abs(normalize_angle(turn)) <= LOOKS_ALONG else None


def _direction(tracker: PathTracker) -> tuple[float, float]:
    """Where a path leads from the robot's place on, seen from above."""
    x, y = (tracker.carried_on(ARM) - tracker.point_at(tracker.progress))[:2].tolist()
    return x, y
