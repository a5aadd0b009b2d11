"""A run with a page that nobody looks at is the same run; Ctrl-C ends it in order."""

import signal
import threading
import urllib.request
from functools import partial

import pytest

from mbf_abstract.event_sinks import read_events
from mbf_abstract.events import EventKind
from mbf_abstract.time.clock import WallClock
from terrain.session.executives import EXECUTIVES, make_executive
from terrain.session.goal_sequence import GoalSequence
from terrain.session.runner import RunOptions, run_scenario
from terrain.session.session import Session, SessionOptions
from terrain.viewer.live.session import LiveSession, ViewOptions
from terrain.viewer.pictures.picture import ViewerMissing


def page(on_page=lambda address: None, **options):
    return partial(LiveSession, options=ViewOptions(**options), on_page=on_page)


def run(meadow, folder, **options):
    return run_scenario(meadow, RunOptions(folder, **options))


def test_a_run_that_is_served_and_a_run_that_is_not_write_the_same_events(meadow, tmp_path):
    addresses = []
    run(meadow, tmp_path / "plain")
    run(
        meadow, tmp_path / "served", watch=page(port=18180, speed=0.0, on_page=addresses.append)
    )  # fmt: skip

    logs = [(tmp_path / name / "events.jsonl").read_bytes() for name in ("plain", "served")]
    assert logs[0] == logs[1]
    assert addresses[0].startswith("http://127.0.0.1:18")


def test_the_page_answers_while_the_run_goes_on_and_is_gone_afterwards(meadow):
    with Session(meadow) as session:
        sequence = GoalSequence(session, make_executive("move_base", session.navigator))
        with LiveSession(session, sequence, ViewOptions(port=18190, speed=0.0)) as live:
            address = live.address
            with urllib.request.urlopen(address, timeout=10.0) as answer:
                assert b"<html" in answer.read().lower()
        with pytest.raises(OSError):
            urllib.request.urlopen(address, timeout=10.0)


def test_ctrl_c_ends_a_run_that_waits_for_goals_and_its_results_are_written(meadow, tmp_path):
    pressed = []

    def press(progress):
        if progress.state == "waiting" and progress.time > 5.0 and not pressed:
            pressed.append(progress.time)
            signal.pthread_kill(threading.get_ident(), signal.SIGINT)  # it does not end the wait of the main thread

    result = run(meadow, tmp_path, watch=page(port=18200, speed=0.0), stay=True, on_progress=press)

    assert result.success and pressed
    assert (tmp_path / "metrics.json").is_file()
    reported = [event.data["reason"] for event in read_events(tmp_path / "events.jsonl") if event.source == "live_view"]
    assert reported == ["Ctrl-C"]


def test_a_page_that_breaks_down_is_reported_once_and_the_run_goes_on(meadow):
    with Session(meadow) as session:
        sequence = GoalSequence(session, make_executive("move_base", session.navigator))
        with LiveSession(session, sequence, ViewOptions(port=18210, speed=0.0)) as live:
            del live._history
            session.loop.on_tick.append(lambda time: sequence.end("done") if sequence.is_waiting else None)
            assert sequence.visit_goals().success
        faults = [event for event in session.memory.of_kind(EventKind.FAULT) if event.source == "live_view"]
        assert len(faults) == 1


def test_a_stick_that_is_held_when_the_run_ends_is_let_go(meadow):
    with Session(meadow) as session:
        sequence = GoalSequence(session, make_executive("move_base", session.navigator), stay=True)
        with LiveSession(session, sequence, ViewOptions(port=18230, speed=0.0)) as live:
            session.loop.on_tick.insert(0, lambda time: live._stick.hold(1, 0.5, 0.0, live._wall.now()))
            session.loop.on_tick.append(lambda time: sequence.end("done") if time > 2.0 else None)
            sequence.visit_goals()
        reasons = [event.data.get("reason") for event in session.memory.of_kind(EventKind.CUSTOM)]
        assert reasons[-1] == "the run has ended"
        assert session.navigator.server.runtime.gate.holder == ""


def test_an_interface_that_does_not_exist_is_reported_in_one_line(meadow, tmp_path):
    with pytest.raises(ViewerMissing, match=r"203\.0\.113\.1.*machine: Cannot assign requested address$"):
        run(meadow, tmp_path, watch=page(host="203.0.113.1"))


@pytest.mark.parametrize("executive", EXECUTIVES)
def test_every_executive_drives_a_run_or_plans_it(meadow, tmp_path, executive):
    result = run(meadow, tmp_path, executive=executive)

    assert result.success, result.verdict
    arrived = result.metrics["distance_to_goal_m"] < 0.5
    assert arrived == (executive != "planning")
    trees = [event for event in read_events(tmp_path / "events.jsonl") if event.kind is EventKind.TREE]
    assert bool(trees) == (executive not in ("move_base", "classic"))


def test_in_real_time_the_world_is_closed_after_the_step_that_is_under_way(meadow):
    session, begun, done = Session(meadow, SessionOptions(wall_clock=True)), [], []

    def look_slowly(time):
        begun.append(time)
        WallClock().sleep(0.15)
        done.append(session.simulation.robot.pose())

    session.loop.on_tick.append(look_slowly)
    session.run()
    session.close()

    assert begun and len(done) == len(begun)
