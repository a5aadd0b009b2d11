"""The transform buffer: where every frame was, for the last seconds, as a tree that can be asked at any time.

Thread-safe with one lock that is never held while foreign code runs. Ask with ``now`` and ``max_age`` wherever a
command depends on the answer: without them the newest transform is returned however old it is.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import reduce

from mbf_abstract.geometry import Path, Pose
from mbf_abstract.geometry.transform import (
    IDENTITY_ROTATION,
    InvalidTransformError,
    Transform,
    TransformError,
    frame_name_problem,
)
from mbf_abstract.geometry.transform_cache import TransformCache

MAX_LEAD = 2.0
"""How far [s] a transform may be stamped in the future. Localisations post-date theirs, commonly by up to a second."""
MAX_LISTED_FRAMES = 20
MAX_PENDING_REQUESTS = 1000


class UnknownFrameError(TransformError):
    """No transform of a frame was ever received."""


class ConnectivityError(TransformError):
    """Both frames are known but belong to different trees."""


class ExtrapolationError(TransformError):
    """The asked time lies outside the kept history."""


class StaleTransformError(TransformError):
    """The newest transform is older than the caller allows, or from the future."""


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
            limit = now() + MAX_LEAD
            self._caches = {child: cache for child, cache in self._caches.items() if cache.forget_after(limit)}

    def set(self, transform: Transform) -> None:
        """Add one transform. A sample older than the history, known already or from the future changes nothing.

        Raises
        ------
        InvalidTransformError
            A frame would be its own ancestor.
        """
        with self._lock:
            self._refuse_loop(transform)
            received = math.inf if self._now is None else self._now()
            if not transform.static and transform.stamp > received + MAX_LEAD:
                ahead = f"{transform.stamp - received:.3f} s ahead of the clock, limit {MAX_LEAD:.3f} s"
                self._refused[transform.child] = f"{transform.parent}->{transform.child} ({ahead})"
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
        for name in (target, source):
            if problem := frame_name_problem(name):
                raise InvalidTransformError(f"no transform from {source!r} to {target!r}: {problem}")
        if target == source:
            return Transform((0.0, 0.0, 0.0), IDENTITY_ROTATION, target, source, time or now or 0.0, static=True)
        with self._lock:
            return self._lookup(target, source, time, now, max_age)

    def can_transform(self, target: str, source: str, time: float | None = None) -> bool:
        """Whether ``lookup`` would answer."""
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
                raise RuntimeError(f"{MAX_PENDING_REQUESTS} transform requests wait already")
            self._requests.append(request)
            answered = self._take_answered_requests()
        for found, answer in answered:
            found.callback(answer)
        return lambda: self._withdraw(request)

    def transform_pose(self, pose: Pose, target: str, time: float | None = None) -> Pose:
        """Express a pose in ``target`` (at the newest time if none is given); raises TransformError."""
        if pose.frame_id == target:
            return pose
        return self.lookup(target, pose.frame_id, time).apply_to_pose(pose)

    def transform_path(self, path: Path, target: str, time: float | None = None) -> Path:
        """Express a path in ``target``; only an unchanged frame keeps its guidance. Raises TransformError."""
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
            problem = _age_problem(now - fresh_at, now - max(stamps), max_age)
            if problem:
                raise StaleTransformError(self._text(target, source, problem, now))
        if any(stamp != time for stamp in stamps):  # the newest of each frame are of different times
            target_parts, source_parts = self._parts(target, source, time, now)
        return _compose(target_parts, source_parts, time)

    def _parts(
        self, target: str, source: str, time: float | None, now: float | None
    ) -> tuple[list[Transform], list[Transform]]:
        """Return the steps from ``target`` and from ``source`` up to where they meet; the newest if no time."""
        if unknown := [repr(name) for name in (source, target) if name not in self._frame_names]:
            reason = " and ".join(unknown) + (" are unknown frames" if len(unknown) == 2 else " is an unknown frame")
            raise UnknownFrameError(self._text(target, source, reason, now))
        target_steps, source_steps = self._walk(target, time), self._walk(source, time)
        target_names = [target, *(step.parent for step in target_steps)]
        source_names = [source, *(step.parent for step in source_steps)]
        for count, name in enumerate(source_names):
            if name in target_names:
                return target_steps[: target_names.index(name)], source_steps[:count]
        for top in (source_names[-1], target_names[-1]):
            if top in self._caches:  # the frame has a parent, but not at this time
                raise ExtrapolationError(self._text(target, source, self._gap_text(top, time), now))
        reason = f"they are in separate trees with the roots {source_names[-1]!r} and {target_names[-1]!r}"
        raise ConnectivityError(self._text(target, source, reason, now))

    def _walk(self, frame: str, time: float | None) -> list[Transform]:
        """Return the steps from a frame up to the root, or to the first frame whose history does not cover the time."""
        steps: list[Transform] = []
        while (cache := self._caches.get(frame)) is not None and len(steps) <= len(self._caches):
            step = cache.newest if time is None else cache.at(time)
            if step is None:
                break
            steps.append(step)
            frame = step.parent
        return steps

    def _refuse_loop(self, transform: Transform) -> None:
        if transform.parent == transform.child:
            raise InvalidTransformError(f"transform {transform.parent!r} -> {transform.child!r}: a frame in itself")
        ancestors = [transform.parent, *(step.parent for step in self._walk(transform.parent, None))]
        if transform.child in ancestors:
            loop = " -> ".join([*ancestors[: ancestors.index(transform.child) + 1], transform.parent])
            raise InvalidTransformError(
                f"transform {transform.parent!r} -> {transform.child!r} closes a loop: {loop} (child -> parent)"
            )

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

    # ------------------------------------------------------------------------------------------------ error texts
    def _text(self, target: str, source: str, reason: str, now: float | None) -> str:
        existing = [_describe_cache(child, cache, now) for child, cache in sorted(self._caches.items())]
        more = f", and {len(existing) - MAX_LISTED_FRAMES} more" if len(existing) > MAX_LISTED_FRAMES else ""
        listed = ", ".join(existing[:MAX_LISTED_FRAMES]) + more if existing else "no transform at all"
        refused = f"; refused: {', '.join(self._refused.values())}" if self._refused else ""
        return f"no transform from {source!r} to {target!r}: {reason}; there is {listed}{refused}"

    def _gap_text(self, child: str, time: float | None) -> str:
        cache = self._caches[child]
        if len(cache) == 1:
            return f"asked for {time:.3f} s, but {child!r} has one sample at {cache.newest.stamp:.3f} s"
        side = "past" if time is not None and time < cache.oldest.stamp else "future"
        span = f"{cache.oldest.stamp:.3f} s to {cache.newest.stamp:.3f} s"
        return f"asked for {time:.3f} s, an extrapolation into the {side}: {child!r} is known from {span}"


def _age_problem(age: float, least_age: float, max_age: float) -> str:
    """Why transforms of these ages [s] are not fresh; ``least_age`` is that of the latest stamp, negative if ahead."""
    if age > max_age:
        return f"the newest is {age:.3f} s old, limit {max_age:.3f} s"
    if least_age < -MAX_LEAD:
        return f"the newest is stamped {-least_age:.3f} s in the future, limit {MAX_LEAD:.3f} s"
    return ""


def _compose(target_steps: list[Transform], source_steps: list[Transform], time: float) -> Transform:
    """``T_target_source`` of the steps from both frames up to where they meet; at least one list has steps."""
    T_common_target, T_common_source = _product(target_steps), _product(source_steps)
    if T_common_target is None:
        assert T_common_source is not None
        return replace(T_common_source, stamp=time)
    T_target_common = T_common_target.inverse()
    T_target_source = T_target_common if T_common_source is None else T_target_common @ T_common_source
    return replace(T_target_source, stamp=time)


def _product(steps: list[Transform]) -> Transform | None:
    """``T_top_bottom`` of steps that lead up from the bottom; None for no steps."""
    return reduce(lambda product, T_parent_child: T_parent_child @ product, steps) if steps else None


def _describe_cache(child: str, cache: TransformCache, now: float | None) -> str:
    newest = cache.newest
    if newest.static:
        return f"{newest.parent}->{child} (static)"
    age = f"at {newest.stamp:.3f} s" if now is None else f"{now - newest.stamp:.3f} s old"
    return f"{newest.parent}->{child} ({age})"
