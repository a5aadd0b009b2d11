"""Nothing that a page asks for stops the world, and who may ask is printed when the page is served."""

import asyncio
import math
import threading
from functools import partial

import msgspec
import pytest
import viser
from typer.testing import CliRunner
from websockets.asyncio.client import connect
from websockets.exceptions import ConnectionClosedError

from mbf_abstract.cli import make_app
from mbf_abstract.events import EventKind
from terrain.session.executives import make_executive
from terrain.session.goal_sequence import GoalSequence
from terrain.session.runner import RunOptions, run_scenario
from terrain.session.session import Session
from terrain.viewer.live.session import LiveSession, ViewOptions

CAMERA = {
    "type": "ViewerCameraMessage", "wxyz": [1.0, 0.0, 0.0, 0.0], "position": [0.0, 0.0, 5.0],
    "look_at": [0.0, 0.0, 0.0], "up_direction": [0.0, 0.0, 1.0],
    "fov": 1.2, "near": 0.1, "far": 1000.0, "image_height": 600, "image_width": 800,
}  # fmt: skip
CLICK = {
    "type": "ScenePointerMessage", "event_type": "click", "ray_origin": [6.0, 5.0, 50.0],
    "ray_direction": [math.nan, 0.0, -1.0], "screen_pos": [[0.5, 0.5]], "modifier": None,
}  # fmt: skip


def refused(events):
    return [
        event.data["message"] for event in events if event.source == "live_view" and event.data["what"] == "refused"
    ]


def test_a_command_that_fails_is_noted_and_the_run_goes_on(steered):
    run = steered()
    run.at(1.0, lambda: 1 / 0, lambda: run.controls.inject("no fault"))
    run.at(1.0, lambda: run.controls.place(("far", None)))

    result = run.visit_goals()

    assert result.success, result.message
    reported = refused(run.events(EventKind.CUSTOM))
    assert len(reported) == 3 and reported[0] == "ZeroDivisionError: division by zero"


def test_what_a_client_sends_neither_raises_nor_stops_a_run_that_ends_in_order(meadow, tmp_path):
    """Every control of the page gets values it cannot have, from a client that has the right address."""
    with Session(meadow) as session:
        sequence = GoalSequence(session, make_executive("move_base", session.navigator), stay=True)
        with LiveSession(session, sequence, ViewOptions(port=18600, speed=0.0)) as live:
            controls, attacked = list(live._page._server.gui._gui_input_handle_from_uuid), threading.Event()
            attacker = threading.Thread(target=lambda: asyncio.run(attack(live, controls, attacked)))
            attacker.start()

            def end_after_both(time):
                if attacked.is_set() and sequence.is_waiting:
                    live.controls.end("done")

            session.loop.on_tick.append(end_after_both)
            result = sequence.visit_goals()
            attacker.join()
        events = session.memory.events

    assert result.success, result.message
    assert not [event for event in events if event.kind is EventKind.FAULT]
    asked = {event.data["what"] for event in events if event.source == "live_view"}
    assert asked <= {"end"}


async def attack(session, controls, attacked):
    """Send every control nonsense and click into nowhere, until the page disconnects or all is sent."""
    try:
        address = session.address.replace("http://", "ws://").rstrip("/")
        origin = "/".join(session.address.split("/")[:3])
        async with connect(address, origin=origin, subprotocols=[f"viser-v{viser.__version__}"]) as socket:
            await socket.send(msgspec.msgpack.encode(CAMERA))
            for control in controls:
                for value in ("nonsense", math.nan, None, [math.inf] * 3, {}, -1e30):
                    update = {"type": "GuiUpdateMessage", "uuid": control, "updates": {"value": value}}
                    await socket.send(msgspec.msgpack.encode(update))
            await socket.send(msgspec.msgpack.encode(CLICK))
            await asyncio.wait_for(await socket.ping(), 20.0)
    except ConnectionClosedError as closed:
        assert closed.rcvd.reason == "too many messages that are refused here"
    finally:
        attacked.set()


def served(meadow, folder, **view):
    """Serve a run; returns the page's address and what else was said of the page."""
    addresses, notes = [], []
    options = ViewOptions(speed=0.0, **view)
    watch = partial(LiveSession, options=options, on_page=addresses.append, on_note=notes.append)
    run_scenario(meadow, RunOptions(folder, watch=watch))
    return addresses, notes


def test_who_serves_a_page_gets_an_address_to_steer_and_one_to_watch(meadow, tmp_path):
    addresses, notes = served(meadow, tmp_path, port=18620)
    (address,), (note,) = addresses, notes
    assert address.startswith("http://127.0.0.1:1862") and len(address.split("/")[3]) >= 22
    assert note.startswith("for those who may only watch: http://127.0.0.1:1862")
    assert address not in note


def test_a_read_only_page_has_no_address_to_steer(meadow, tmp_path):
    addresses, notes = served(meadow, tmp_path, port=18640, read_only=True)
    assert len(addresses) == 1 and notes == []


def test_other_machines_are_warned_of(meadow, tmp_path):
    _, notes = served(meadow, tmp_path, port=18660, host="0.0.0.0")
    assert "warning: other machines can reach the page at 0.0.0.0" in notes[-1]


def test_other_machines_never_get_in_without_a_token(tmp_path):
    with pytest.raises(ValueError, match="loopback only"):
        ViewOptions(host="0.0.0.0", token=False)
    arguments = [
        "run",
        "outdoor",
        "--view",
        "--view-host",
        "0.0.0.0",
        "--no-view-token",
        "--out",
        str(tmp_path / "run"),
    ]
    result = CliRunner().invoke(make_app(), arguments)
    assert result.exit_code == 2 and "without a token" in result.output
    assert not (tmp_path / "run").exists()
