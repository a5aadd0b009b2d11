"""Waiting for a goal in an asyncio task."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager, suppress
from typing import Any, Protocol, TypeVar

from mbf_abstract.goals.result_types import ActionResult

R = TypeVar("R", bound=ActionResult)
R_co = TypeVar("R_co", bound=ActionResult, covariant=True)


class Awaitable(Protocol[R_co]):
    """What is needed of a goal handle."""

    @property
    def done(self) -> bool:
        """Whether the goal is over."""

    @property
    def result(self) -> R_co | None:
        """Result of a goal that is over."""

    def subscribe(self, callback: Callable[[Any], None], /) -> None:
        """Call ``callback`` at every change, and once at once."""

    def cancel(self, reason: str, /) -> None:
        """Ask the goal to end."""


class OutsideClock(Protocol):
    """A clock that does not wait for a thread that waits elsewhere."""

    def outside(self) -> AbstractContextManager[None]:
        """Leave the clock's threads for the time of a ``with`` block."""


async def awaited(handle: Awaitable[R], clock: OutsideClock) -> R:
    """Result of a goal; a task that is canceled while it waits cancels the goal."""
    import asyncio  # only who awaits a goal needs it; it takes 20 ms

    loop = asyncio.get_running_loop()
    finished = loop.create_future()

    def set_finished() -> None:
        if not finished.done():
            finished.set_result(None)

    def wake(_: object) -> None:
        if handle.done and not loop.is_closed():
            with suppress(RuntimeError):  # the loop was closed at this moment
                loop.call_soon_threadsafe(set_finished)

    handle.subscribe(wake)
    try:
        with clock.outside():
            await finished
    except asyncio.CancelledError:
        handle.cancel("the task that awaited the goal was canceled")
        raise
    assert handle.result is not None
    return handle.result
