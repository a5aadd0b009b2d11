"""A map as a server runs it: stopped while nobody uses it, started by its users, fresh at every start."""

from types import MappingProxyType

import pytest

from mbf_abstract.maps.layers.layer import LayerParameters, MapLayer
from mbf_abstract.maps.layers.layer_list import LayerListError
from mbf_abstract.maps.layers.layer_stack import LayerStack
from mbf_abstract.maps.served_map import ServedMap
from mbf_abstract.testing.scripted_session import ScriptedSession


class CountedMap:
    """A map that counts what is done to it."""

    frame_id, follows_robot, layers, floors_taken = "map", False, MappingProxyType({}), 0

    def __init__(self):
        self.updates, self.cleared = [], 0

    def update(self, robot_pose, now):
        self.updates.append(now)

    def clear(self):
        self.cleared += 1

    def tracked_objects(self, now):
        return ()


@pytest.fixture
def serve():
    """``serve(**navigation parameters)``: a counted map, served at 10 Hz, and its session."""
    sessions = []

    def make(**parameters):
        sessions.append(session := ScriptedSession(**parameters))
        served = ServedMap(CountedMap(), session.server.runtime, "map", None, 10.0)
        session.on_close(served.close)
        return served, session

    yield make
    for session in sessions:
        session.close()


def is_updated(served, session):
    """Whether the map was updated within the last period."""
    session.clock.sleep(0.15)
    return bool(served.map.updates) and session.clock.now() - served.map.updates[-1] < 0.1


def test_without_shutdown_the_map_is_updated_from_the_start(serve):
    served, session = serve()
    assert served.map.updates == [0.0]
    with served.in_use():
        pass
    session.clock.sleep(100.0)
    assert is_updated(served, session) and served.map.cleared == 0


def test_with_shutdown_the_first_user_starts_the_map_and_the_last_one_stops_it_after_the_delay(serve):
    served, session = serve(shutdown_costmaps=True, shutdown_costmaps_delay=1.0)
    session.clock.sleep(5.0)
    assert served.map.updates == []
    with served.in_use():
        assert served.map.updates == [5.0]
        with served.in_use():
            pass
        session.clock.sleep(50.0)
        assert is_updated(served, session), "one user is left"
    session.clock.sleep(0.7)
    assert is_updated(served, session), "the delay is not over"
    session.clock.sleep(0.3)
    assert not is_updated(served, session)


def test_a_user_within_the_delay_keeps_the_map_running(serve):
    served, session = serve(shutdown_costmaps=True, shutdown_costmaps_delay=1.0)
    for _ in range(3):
        with served.in_use():
            pass
        session.clock.sleep(0.75)
        assert is_updated(served, session)


def test_the_map_is_cleared_when_it_stops_if_so_configured(serve):
    served, session = serve(shutdown_costmaps=True, shutdown_costmaps_delay=0.0, clear_on_shutdown=True)
    with served.in_use():
        pass
    session.clock.sleep(1.0)
    assert (served.map.cleared, len(served.map.updates)) == (1, 1)


def test_a_user_whose_work_fails_or_whose_map_cannot_start_is_none(serve):
    served, session = serve(shutdown_costmaps=True, shutdown_costmaps_delay=0.5)
    with pytest.raises(RuntimeError, match="boom"), served.in_use():
        raise RuntimeError("boom")
    session.clock.sleep(1.0)
    assert not is_updated(served, session)

    update = served.map.update
    served.map.update = lambda *_: 1 / 0
    with pytest.raises(ZeroDivisionError), served.in_use():
        pass
    served.map.update = update
    session.clock.sleep(1.0)
    assert not is_updated(served, session)


def test_switching_the_parameter_starts_or_stops_an_idle_map(serve):
    served, session = serve(shutdown_costmaps=True, shutdown_costmaps_delay=1.0)
    session.server.set_parameters(shutdown_costmaps=False)
    assert is_updated(served, session)
    session.server.set_parameters(shutdown_costmaps=True)
    session.clock.sleep(0.6)
    assert is_updated(served, session)
    session.clock.sleep(0.6)
    assert not is_updated(served, session)


def test_a_layer_that_raises_in_the_first_update_is_named(serve):
    class BadMap(CountedMap):
        layers = LayerStack()

        def update(self, robot_pose, now):
            with self.layers.computing(MapLayer("mine", LayerParameters())):
                raise SystemExit(3)

    _, session = serve()
    with pytest.raises(LayerListError, match="map: layer 'mine' raised SystemExit: 3"):
        ServedMap(BadMap(), session.server.runtime, "map", None, 10.0)
