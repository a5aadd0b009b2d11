"""What can be wrong with a transform that is asked for, and the texts of it."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence

from mbf_abstract.geometry.transform import InvalidTransformError, Transform, TransformError
from mbf_abstract.geometry.transform_cache import TransformCache

MAX_LEAD = 2.0
"""How far [s] a transform may be stamped in the future. Localisations post-date theirs, commonly by up to a second."""
MAX_LISTED_FRAMES = 20


class UnknownFrameError(TransformError):
    """No transform of a frame was ever received."""


class ConnectivityError(TransformError):
    """Both frames are known but belong to different trees."""


class ExtrapolationError(TransformError):
    """The asked time lies outside the kept history."""


class StaleTransformError(TransformError):
    """The newest transform is older than the caller allows, or from the future."""


def refuse_loop(transform: Transform, ancestors: Sequence[str]) -> None:
    """Raise InvalidTransformError if a transform leads to one of its ``ancestors``: the frames above its parent."""
    if transform.parent == transform.child:
        raise InvalidTransformError(f"{_name(transform)}: a frame in itself")
    chain = [transform.parent, *ancestors]
    if transform.child in chain:
        loop = " -> ".join([*chain[: chain.index(transform.child) + 1], transform.parent])
        raise InvalidTransformError(f"{_name(transform)} closes a loop: {loop} (child -> parent)")


def _name(transform: Transform) -> str:
    return f"transform {transform.parent!r} -> {transform.child!r}"


def ahead_text(transform: Transform, received: float) -> str:
    """By how much a transform that was ``received`` [s] is from the future."""
    ahead = f"{transform.stamp - received:.3f} s ahead of the clock, limit {MAX_LEAD:.3f} s"
    return f"{transform.parent}->{transform.child} ({ahead})"


def age_problem(age: float, least_age: float, max_age: float) -> str:
    """Why transforms of these ages [s] are not fresh; ``least_age`` is that of the latest stamp, negative if ahead."""
    if age > max_age:
        return f"the newest is {age:.3f} s old, limit {max_age:.3f} s"
    if least_age < -MAX_LEAD:
        return f"the newest is stamped {-least_age:.3f} s in the future, limit {MAX_LEAD:.3f} s"
    return ""


def lookup_text(
    target: str,
    source: str,
    reason: str,
    caches: Mapping[str, TransformCache],
    refused: Collection[str],
    now: float | None,
) -> str:
    """Why there is no transform between two frames, which transforms there are, and which were refused."""
    existing = [_describe_cache(child, cache, now) for child, cache in sorted(caches.items())]
    more = f", and {len(existing) - MAX_LISTED_FRAMES} more" if len(existing) > MAX_LISTED_FRAMES else ""
    listed = ", ".join(existing[:MAX_LISTED_FRAMES]) + more if existing else "no transform at all"
    others = f"; refused: {', '.join(refused)}" if refused else ""
    return f"no transform from {source!r} to {target!r}: {reason}; there is {listed}{others}"


def gap_text(child: str, cache: TransformCache, time: float | None) -> str:
    """Which times of a frame are known, as the one asked for is not."""
    if len(cache) == 1:
        return f"asked for {time:.3f} s, but {child!r} has one sample at {cache.newest.stamp:.3f} s"
    side = "past" if time is not None and time < cache.oldest.stamp else "future"
    span = f"{cache.oldest.stamp:.3f} s to {cache.newest.stamp:.3f} s"
    return f"asked for {time:.3f} s, an extrapolation into the {side}: {child!r} is known from {span}"


def _describe_cache(child: str, cache: TransformCache, now: float | None) -> str:
    newest = cache.newest
    if newest.static:
        return f"{newest.parent}->{child} (static)"
    age = f"at {newest.stamp:.3f} s" if now is None else f"{now - newest.stamp:.3f} s old"
    return f"{newest.parent}->{child} ({age})"
