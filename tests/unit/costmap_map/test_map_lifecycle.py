"""Starting and stopping a map by its users."""

import pytest

from mbf_costmap_nav.map.map_lifecycle import MapLifecycle, MapLifecycleParameters


class SetClock:
    """A clock that shows what it is set to."""

    time = 0.0

    def now(self) -> float:
        return self.time


@pytest.fixture
def clock():
    return SetClock()


@pytest.fixture
def calls():
    return []


@pytest.fixture
def make(clock, calls):
    def lifecycle(**parameters):
        hooks = (lambda name=name: calls.append(name) for name in ("start", "stop", "clear"))
        return MapLifecycle(clock, MapLifecycleParameters(**parameters), *hooks)

    return lifecycle


def test_without_shutdown_the_map_runs_from_the_start(make, clock, calls):
    lifecycle = make()
    lifecycle.activate()
    lifecycle.deactivate()
    clock.time = 100.0
    lifecycle.poll()
    assert lifecycle.running and calls == ["start"]


def test_with_shutdown_the_first_user_starts_and_the_delay_stops(make, clock, calls):
    lifecycle = make(shutdown_costmaps=True, shutdown_costmaps_delay=1.0)
    assert not lifecycle.running
    lifecycle.activate()
    lifecycle.activate()
    lifecycle.deactivate()
    clock.time = 50.0
    lifecycle.poll()
    assert lifecycle.running, "one user is left"
    lifecycle.deactivate()
    clock.time = 50.9
    lifecycle.poll()
    assert calls == ["start"]
    clock.time = 51.0
    lifecycle.poll()
    assert calls == ["start", "stop"] and not lifecycle.running


def test_a_user_within_the_delay_keeps_the_map_running(make, clock, calls):
    lifecycle = make(shutdown_costmaps=True, shutdown_costmaps_delay=1.0)
    with lifecycle.in_use():
        pass
    clock.time = 0.9
    with lifecycle.in_use():
        clock.time = 5.0
        lifecycle.poll()
    lifecycle.poll()
    assert calls == ["start"]


def test_the_map_is_cleared_before_it_stops(make, clock, calls):
    lifecycle = make(shutdown_costmaps=True, shutdown_costmaps_delay=0.0, clear_on_shutdown=True)
    with lifecycle.in_use():
        pass
    lifecycle.poll()
    assert calls == ["start", "clear", "stop"]


def test_a_user_is_given_back_when_its_work_fails(make):
    lifecycle = make(shutdown_costmaps=True)
    with pytest.raises(RuntimeError, match="boom"), lifecycle.in_use():
        raise RuntimeError("boom")
    assert lifecycle.users == 0


def test_switching_the_parameter_starts_or_stops_an_idle_map(make, clock, calls):
    lifecycle = make(shutdown_costmaps=True)
    lifecycle.configure(MapLifecycleParameters(shutdown_costmaps=False))
    assert lifecycle.running
    lifecycle.configure(MapLifecycleParameters(shutdown_costmaps=True, shutdown_costmaps_delay=1.0))
    clock.time = 1.0
    lifecycle.poll()
    assert not lifecycle.running and calls == ["start", "stop"]


def test_giving_back_a_user_that_never_was_is_an_error(make):
    with pytest.raises(RuntimeError, match="without activate"):
        make().deactivate()
