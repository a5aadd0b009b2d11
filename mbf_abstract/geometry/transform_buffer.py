"""The transform buffer: where every frame was, for the last seconds, as a tree that can be asked at any time.

Thread-safe with one lock that is never held while foreign code runs. Ask with ``now`` and ``max_age`` wherever a
command depends on the answer: without them the newest transform is returned however old it is.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Callable
from dataclasses import dataclass

from mbf_abstract.geometry import Path, Pose
from mbf_abstract.geometry.transform import (
    IDENTITY_ROTATION,
    InvalidTransformError,
    Transform,
    TransformError,
    composed,
    frame_name_problem,
)
from mbf_abstract.geometry.transform_cache import TransformCache, steps_up
from mbf_abstract.geometry.transform_problems import (
    MAX_LEAD,
    ConnectivityError,
    ExtrapolationError,
    StaleTransformError,
    UnknownFrameError,
    age_problem,
    ahead_text,
    gap_text,
    lookup_text,
    refuse_loop,
)

MAX_PENDING_REQUESTS = 1000


@dataclass(frozen=True)
class _Request:
    target: str
    source: str
    time: float | None
    callback: Callable[[Transform], None]


class TransformBuffer:
    """A tree of frames with a short history.

    Parameters
    ----------
    cache_time : float
        Length of the history [s] kept of each frame.

    Notes
    -----
    ``time=None`` asks for the newest common time: the oldest of the newest stamps of all moving transforms involved.
    """

    def __init__(self, cache_time: float = 10.0) -> None:
        self.cache_time = cache_time
        self._caches: dict[str, TransformCache] = {}  # by child frame
        self._frame_names: dict[str, None] = {}  # an ordered set
        self._refused: dict[str, str] = {}  # by child frame: the last transform from the future
        self._now: Callable[[], float] | None = None
        self._requests: list[_Request] = []
        self._lock = threading.Lock()

    def follow_clock(self, now: Callable[[], float]) -> None:
        """Measure ages by this clock from now on, and forget what is stamped over ``MAX_LEAD`` after it.

        With a clock a transform ages from when it came, where its stamp is later. The server gives it its own.
        """
        with self._lock:
            self._now = now
            self._caches = {name: one for name, one in self._caches.items() if one.forget_after(now() + MAX_LEAD)}

    def set(self, transform: Transform) -> None:
        """Add one transform. A sample older than the history, known already or from the future changes nothing.

        Raises
        ------
        InvalidTransformError
            A frame would be its own ancestor.
        """
        with self._lock:
            refuse_loop(transform, [step.parent for step in steps_up(self._caches, transform.parent)])
            received = math.inf if self._now is None else self._now()
            if not transform.static and transform.stamp > received + MAX_LEAD:
                self._refused[transform.child] = ahead_text(transform, received)
                return
            self._refused.pop(transform.child, None)
            cache = self._caches.setdefault(transform.child, TransformCache(self.cache_time))
            cache.insert(transform, received)
            self._frame_names.update({transform.parent: None, transform.child: None})
            answered = self._take_answered_requests()
        for request, answer in answered:
            request.callback(answer)

    def clear(self) -> None:
        """Forget all transforms, static ones too; requests stay."""
        with self._lock:
            self._caches.clear()
            self._frame_names.clear()
            self._refused.clear()

    def frames(self) -> list[str]:
        """Return the names of all known frames, sorted."""
        with self._lock:
            return sorted(self._frame_names)

    def newest(self) -> list[Transform]:
        """Return the newest transform of each frame to its parent, by the names of the frames."""
        with self._lock:
            return [cache.newest for _, cache in sorted(self._caches.items())]

    def lookup(
        self,
        target: str,
        source: str,
        time: float | None = None,
        *,
        now: float | None = None,
        max_age: float | None = None,
    ) -> Transform:
        """Return ``T_target_source``, which maps coordinates in ``source`` to coordinates in ``target``.

        Parameters
        ----------
        target, source : str
            Frames; equal frames give the identity without a look at the tree.
        time : float, optional
            Time [s] of the answer; the newest common time if not given.
        now, max_age : float, optional
            Refuse an answer that is older than ``max_age`` [s] at ``now``, or stamped over ``MAX_LEAD`` after it. A
            transform ages from its stamp, or from when it came if its stamp is later. Static ones do not age.

        Raises
        ------
        InvalidTransformError
            A frame name is empty or starts with ``/``.
        UnknownFrameError, ConnectivityError, ExtrapolationError, StaleTransformError
            See there.
        """
        if problem := frame_name_problem(target) or frame_name_problem(source):
            raise InvalidTransformError(f"no transform from {source!r} to {target!r}: {problem}")
        if target == source:
            return Transform((0.0, 0.0, 0.0), IDENTITY_ROTATION, target, source, time or now or 0.0, static=True)
        with self._lock:
            return self._lookup(target, source, time, now, max_age)

    def can_transform(self, target: str, source: str, time: float | None = None) -> bool:
        """Whether ``lookup`` would answer at ``time`` [s], or at the newest common one."""
        try:
            self.lookup(target, source, time)
        except TransformError:
            return False
        return True

    def when_available(
        self, target: str, source: str, time: float | None, callback: Callable[[Transform], None]
    ) -> Callable[[], None]:
        """Call ``callback`` with the transform once there is one, perhaps at once; returns a function to withdraw.

        The callback runs in the thread that delivers the missing transform, and not under the buffer's lock.

        Raises
        ------
        RuntimeError
            1000 requests wait already.
        """
        request = _Request(target, source, time, callback)
        with self._lock:
            if len(self._requests) >= MAX_PENDING_REQUESTS:
                raise RuntimeError(f"{MAX_PENDING_REQUESTS} transform requests are pending already")
            self._requests.append(request)
            answered = self._take_answered_requests()
        for found, answer in answered:
            found.callback(answer)
        return lambda: self._withdraw(request)

    def transform_pose(self, pose: Pose, target: str, time: float | None = None) -> Pose:
        """Express a pose in ``target`` at ``time`` [s], the newest if none is given; raises TransformError."""
        if pose.frame_id == target:
            return pose
        return self.lookup(target, pose.frame_id, time).apply_to_pose(pose)

    def transform_path(self, path: Path, target: str, time: float | None = None) -> Path:
        """Express a path in ``target``, like a pose; only an unchanged frame keeps guidance. Raises TransformError."""
        if path.frame_id == target:
            return path
        return self.lookup(target, path.frame_id, time).apply_to_path(path)

    # ------------------------------------------------------------------------ private; the caller holds the lock
    def _lookup(
        self, target: str, source: str, time: float | None, now: float | None = None, max_age: float | None = None
    ) -> Transform:
        target_parts, source_parts = self._parts(target, source, time, now)
        moving = [part for part in (*target_parts, *source_parts) if not part.static]
        stamps = [part.stamp for part in moving]
        asked = time
        if time is None:
            time = min(stamps) if stamps else now or 0.0
        if moving and now is not None and max_age is not None:
            fresh_at = min(self._caches[part.child].fresh_at for part in moving) if asked is None else asked
            problem = age_problem(now - fresh_at, now - max(stamps), max_age)
            if problem:
                raise StaleTransformError(self._text(target, source, problem, now))
        if any(stamp != time for stamp in stamps):  # the newest of each frame are of different times
            target_parts, source_parts = self._parts(target, source, time, now)
        return composed(target_parts, source_parts, time)

    def _parts(
        self, target: str, source: str, time: float | None, now: float | None
    ) -> tuple[list[Transform], list[Transform]]:
        """Return the steps from ``target`` and from ``source`` up to where they meet; the newest if no time."""
        if unknown := [repr(name) for name in (source, target) if name not in self._frame_names]:
            reason = " and ".join(unknown) + (" are unknown frames" if len(unknown) == 2 else " is an unknown frame")
            raise UnknownFrameError(self._text(target, source, reason, now))
        target_steps, source_steps = steps_up(self._caches, target, time), steps_up(self._caches, source, time)
        target_names = [target, *(step.parent for step in target_steps)]
        source_names = [source, *(step.parent for step in source_steps)]
        for count, name in enumerate(source_names):
            if name in target_names:
                return target_steps[: target_names.index(name)], source_steps[:count]
        for top in (source_names[-1], target_names[-1]):
            if top in self._caches:  # the frame has a parent, but not at this time
                raise ExtrapolationError(self._text(target, source, gap_text(top, self._caches[top], time), now))
        reason = f"they are in separate trees with the roots {source_names[-1]!r} and {target_names[-1]!r}"
        raise ConnectivityError(self._text(target, source, reason, now))

    def _take_answered_requests(self) -> list[tuple[_Request, Transform]]:
        answered, waiting = [], []
        for request in self._requests:
            try:
                answered.append((request, self._lookup(request.target, request.source, request.time)))
            except TransformError:
                waiting.append(request)
        self._requests = waiting
        return answered

    def _withdraw(self, request: _Request) -> None:
        with self._lock:
            if request in self._requests:
                self._requests.remove(request)

    def _text(self, target: str, source: str, reason: str, now: float | None) -> str:
        return lookup_text(target, source, reason, self._caches, self._refused.values(), now)
