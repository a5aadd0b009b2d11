"""What changes among tracked objects from update to update, for the event log."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from mbf_abstract.maps.tracking.objects import Motion, TrackedObject

GONE = "gone"
MOST_REPORTS = 20
"""Most changes that one update reports; the next one reports those that are left."""


class MotionChanges:
    """Remembers what was last reported of each object; those that only ever stood are not reported."""

    def __init__(self) -> None:
        self._reported: dict[int, TrackedObject] = {}

    def changes(self, objects: Sequence[TrackedObject]) -> Iterator[dict[str, object]]:
        """Yield the data of an event for each object that has begun to move, has stopped, is parked or is gone."""
        left = MOST_REPORTS
        numbers = {known.number for known in objects}
        for known in objects:
            last = self._reported.get(known.number)
            changed = known.motion is Motion.MOVING if last is None else known.motion is not last.motion
            if changed and left > 0:
                self._reported[known.number] = known
                left -= 1
                yield known.to_data()
        for number in [number for number in self._reported if number not in numbers][:left]:
            yield self._reported.pop(number).to_data() | {"motion": GONE}
