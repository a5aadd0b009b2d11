"""The options ``--view`` and ``--foxglove`` of ``mbf run``: a run that is watched and steered while it goes on."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from typing import TYPE_CHECKING

import typer

if TYPE_CHECKING:
    from mbf_abstract.access.foxglove import FoxgloveOptions
    from terrain.commands.live_line import LiveLine
    from terrain.session.goal_sequence import GoalSequence
    from terrain.session.run_options import RunOptions, Watch
    from terrain.session.session import Session
    from terrain.viewer.live.session import ViewOptions


def watched(
    options: RunOptions,
    page: ViewOptions | None,
    foxglove: FoxgloveOptions | None,
    speed: float,
    live: LiveLine,
    show: bool = False,
) -> RunOptions:
    """Serve a page of the run, the app Foxglove, or both.

    Parameters
    ----------
    page, foxglove : ViewOptions, FoxgloveOptions
        None where it is not served.
    speed : float
        Simulated seconds per second.
    live : LiveLine
        Prints addresses.
    show : bool
        Whether the page is opened in the browser.
    """
    watches: list[Watch] = []
    if page is not None:
        watches.append(_live_view(page, live, show))
    if foxglove is not None:
        watches.append(_live_foxglove(foxglove, speed, live))

    @contextmanager
    def watch(session: Session, goals: GoalSequence) -> Iterator[None]:
        with ExitStack() as served:
            for one in watches:
                served.enter_context(one(session, goals))
            yield

    return replace(options, watch=watch) if watches else options


def _live_view(page: ViewOptions, live: LiveLine, show: bool) -> Watch:
    """Return what serves the page of a session while it runs, and prints its address or opens it, too."""
    from terrain.viewer.live.session import LiveSession

    def watch(session: Session, goals: GoalSequence) -> LiveSession:
        title = _title("live view", session)

        def on_page(address: str) -> None:
            live.note(f"{title} at {address}")
            if show:
                typer.launch(address)

        return LiveSession(session, goals, page, on_page, live.note)

    return watch


def _live_foxglove(options: FoxgloveOptions, speed: float, live: LiveLine) -> Watch:
    """Return what serves a session to Foxglove while it runs, and prints the address.

    Raises
    ------
    ValueError
        A package is missing.
    """
    try:
        from terrain.viewer.foxglove.live import LiveFoxglove
    except ImportError as error:
        raise ValueError(f"--foxglove needs more packages: pip install 'mbf-flex[foxglove]' ({error})") from error

    return lambda session, goals: LiveFoxglove(session, goals, options, speed, live.note, _title("Foxglove", session))


def _title(what: str, session: Session) -> str:
    """What is served; of one of several robots with its name."""
    _, _, name = session.scenario.name.partition("/")
    return f"{what} of {name}" if name else what
