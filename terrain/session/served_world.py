"""A scenario in real time, for packages that serve a robot to others: the entry point ``mbf.worlds``."""

from __future__ import annotations

from collections.abc import Callable

from terrain.session.session import Session, SessionOptions


def open_world(scenario: str, backend: str | None, seed: int | None, on_step: Callable[[str], None]) -> Session:
    """Build a scenario on the wall clock, without an executive; time passes inside its context.

    Parameters
    ----------
    scenario : str
        Name of a shipped scenario, or a file.
    seed : int, optional
        Instead of the scenario's own.
    on_step : callable
        Called with the name of each step of the preparation.

    Raises
    ------
    ConfigError
        The scenario, or its configuration for the backend, is wrong; all findings.
    """
    return Session(scenario, SessionOptions(backend=backend, seed=seed, wall_clock=True, on_step=on_step))
