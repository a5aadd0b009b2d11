"""Strangers do not get into a page, and whoever is in cannot say anything but what the page's own script says."""

import asyncio
import http.client
import math
import socket
import urllib.request
from contextlib import closing

import msgspec
import numpy as np
import pytest
import viser
from websockets.asyncio.client import connect
from websockets.exceptions import ConnectionClosed, InvalidStatus

from mbf_abstract.access.page_access import NOBODY, PageAccess, Role, is_loopback
from terrain.viewer.server.page_guard import MAX_REFUSED, MAX_VISITORS
from terrain.viewer.server.page_messages import is_allowed
from terrain.viewer.server.page_server import page_server

PORT = 18500
PROTOCOL = [f"viser-v{viser.__version__}"]
CAMERA = {
    "type": "ViewerCameraMessage",
    "wxyz": [1.0, 0.0, 0.0, 0.0],
    "position": [0.0, 0.0, 5.0],
    "look_at": [0, 0, 0],
    "up_direction": [0.0, 0.0, 1.0],
    "fov": 1.2,
    "near": 0.1,
    "far": 1000.0,
    "image_height": 600,
    "image_width": 800,
}
CLICK = {
    "type": "ScenePointerMessage",
    "event_type": "click",
    "ray_origin": [0.0, 0.0, 5.0],
    "ray_direction": [0.0, 0.0, -1.0],
    "screen_pos": [[0.5, 0.5]],
    "modifier": None,
}


class Guarded:
    """A page with controls, served; ``share_requests`` counts who has asked viser for a public tunnel."""

    def __init__(self, server, access):
        self.server, self.access, self.port = server, access, server.get_port()
        self.share_requests = 0
        gui = server.gui
        self.number = gui.add_number("seconds", 5.0, min=0.1, max=60.0)
        self.choice = gui.add_dropdown("kind", ("silent", "stale"))
        self.box = gui.add_checkbox("on", True)
        self.vector = gui.add_vector3("by", (0.5, 0.0, 0.0))
        self.button = gui.add_button("press")
        self.pressed, self.clicked = [], []
        self.button.on_click(lambda event: self.pressed.append(1))
        server.scene.on_click()(lambda event: self.clicked.append(event.ray_direction))
        server.request_share_url = self._count_share

    def _count_share(self, *args, **kw):
        self.share_requests += 1

    def socket(self, role=Role.STEER, host=None, origin="own", path=None):
        """Connect as a browser would, or otherwise."""
        host = host or f"127.0.0.1:{self.port}"
        token = next((token for token, allowed in self.access.roles.items() if allowed is role), "")
        path = f"/{token}" if path is None else path
        origin = f"http://{host}" if origin == "own" else origin
        return connect(f"ws://{host}{path}", host="127.0.0.1", port=self.port, origin=origin, subprotocols=PROTOCOL)

    def page(self, path, **headers):
        """Status and text of a GET request."""
        with closing(http.client.HTTPConnection("127.0.0.1", self.port, timeout=10.0)) as connection:
            connection.request("GET", path, headers=headers)
            with connection.getresponse() as answer:
                return answer.status, answer.read(), answer.headers

    def say(self, *messages, role=Role.STEER):
        """Send messages, raw bytes or fields, then let viser work them off; returns whether it still listens."""

        async def talk():
            async with self.socket(role) as socket:
                await socket.send(msgspec.msgpack.encode(CAMERA))
                for message in messages:
                    await socket.send(message if isinstance(message, bytes | str) else msgspec.msgpack.encode(message))
                await socket.send(msgspec.msgpack.encode(update(self.vector, [0.0, 0.0, 9.0])))
                if role is Role.STEER:
                    await self._until(lambda: self.vector.value == (0.0, 0.0, 9.0))
                await asyncio.wait_for(await socket.ping(), 10.0)

        asyncio.run(talk())
        return self

    async def _until(self, condition):
        await asyncio.wait_for(self._poll(condition), 10.0)

    async def _poll(self, condition):
        while not condition():
            await asyncio.sleep(0.01)

    @property
    def state(self):
        return self.number.value, self.choice.value, self.box.value, self.number.label, self.share_requests


def update(control, value, name="value"):
    return {"type": "GuiUpdateMessage", "uuid": control._impl.uuid, "updates": {name: value}}


@pytest.fixture(scope="module")
def guarded():
    access = PageAccess.by_token()
    with page_server(PORT, access) as server:
        yield Guarded(server, access)


@pytest.fixture
def untouched(guarded):
    """The page, with the values it was made with."""
    guarded.number.value, guarded.choice.value, guarded.box.value = 5.0, "silent", True
    guarded.vector.value = (0.5, 0.0, 0.0)
    guarded.pressed.clear(), guarded.clicked.clear()
    return guarded


# --------------------------------------------------------------------------------------------------- getting in
def test_the_page_is_served_at_the_address_with_the_token_and_nowhere_else(guarded):
    token = next(iter(guarded.access.roles))
    status, text, headers = guarded.page(f"/{token}/")
    assert status == 200 and b"<html" in text.lower()
    assert (headers["Referrer-Policy"], headers["X-Frame-Options"]) == ("no-referrer", "DENY")
    for path in ("/", "/index.html", f"/{token[:-1]}/", f"/{token}x/", f"//{token}/", "/" + "a" * 5_000):
        assert guarded.page(path)[0] == 403, path


@pytest.mark.parametrize(
    "how",
    [
        {"path": "/"},
        {"path": ""},
        {"path": "/wrong"},
        {"origin": "http://evil.example"},
        {"origin": "http://127.0.0.1:1"},
        {"origin": "null"},
        {"origin": None},
        {"host": "evil.example:18500"},
        {"host": "evil.example:18500", "origin": "http://evil.example:18500"},
        {"host": "127.0.0.1.evil.example"},
        {"host": "192.0.2.7:18500"},
    ],
    ids=str,
)
def test_a_websocket_from_elsewhere_is_refused(guarded, how):
    async def try_it():
        async with guarded.socket(**how):
            return "let in"

    with pytest.raises(InvalidStatus) as refused:
        asyncio.run(try_it())
    assert refused.value.response.status_code == 403
    assert guarded.server.get_clients() == {}


@pytest.mark.parametrize("host", ["127.0.0.1:{}", "localhost:{}", "LOCALHOST:{}", "[::1]:{}", "localhost:9000"])
def test_every_name_of_this_machine_and_a_forwarded_port_will_do(guarded, host):
    async def try_it():
        async with guarded.socket(host=host.format(guarded.port)) as socket:
            await socket.ping()

    asyncio.run(try_it())


@pytest.mark.parametrize(
    "headers",
    [{"Host": "evil.example"}, {"Host": ""}, {"Host": "127.0.0.1@evil.example"}, {"Host": "[127.0.0.1"}],
    ids=str,
)
def test_a_page_is_not_served_under_a_foreign_name(guarded, headers):
    assert guarded.page(f"/{next(iter(guarded.access.roles))}/", **headers)[0] == 403


def test_garbage_instead_of_a_request_disturbs_nobody(guarded, capfd):
    rng = np.random.default_rng(5)
    for _ in range(20):
        with socket.create_connection(("127.0.0.1", guarded.port), timeout=10.0) as stranger:
            stranger.sendall(rng.bytes(300) + b"\r\n\r\n")
    assert guarded.page(f"/{next(iter(guarded.access.roles))}/")[0] == 200
    assert capfd.readouterr() == ("", "")


def test_a_page_for_nobody_is_a_page_for_nobody():
    """The scene of a replay is put up in a server, too."""
    with page_server(PORT + 20, NOBODY) as server:
        page = Guarded(server, NOBODY)
        assert page.page("/")[0] == 403
        with pytest.raises(InvalidStatus):
            asyncio.run(open_and_close(page))


async def open_and_close(page):
    async with page.socket():
        pass


def test_there_are_only_so_many_visitors_at_a_time(guarded):
    async def crowd():
        sockets = [await guarded.socket() for _ in range(MAX_VISITORS)]
        late = await guarded.socket()
        with pytest.raises(ConnectionClosed) as closed:
            await late.recv()
        for early in sockets:
            await early.close()
        return closed.value.rcvd.code

    assert asyncio.run(crowd()) == 1013


# ---------------------------------------------------------------------------------------------- what may be said
def test_who_may_steer_presses_clicks_and_sets_values(untouched):
    untouched.say(
        CLICK, update(untouched.button, True), update(untouched.number, 7), update(untouched.choice, "stale")
    )  # fmt: skip
    assert untouched.state == (7.0, "stale", True, "seconds", 0)
    asyncio.run(untouched._until(lambda: untouched.pressed and untouched.clicked))


def test_who_may_watch_changes_nothing(untouched):
    pressed, cleared = update(untouched.button, True), update(untouched.box, False)
    untouched.say(CLICK, pressed, cleared, update(untouched.number, 7.0), role=Role.WATCH)
    assert untouched.state == (5.0, "silent", True, "seconds", 0)
    assert not untouched.pressed and not untouched.clicked and untouched.vector.value == (0.5, 0.0, 0.0)


def test_nobody_can_ask_for_a_public_tunnel(untouched):
    untouched.say({"type": "ShareUrlRequest"}, {"type": "ShareUrlDisconnect"})
    assert untouched.share_requests == 0 and untouched.server._share_tunnel is None


def test_no_value_that_a_control_cannot_have_reaches_it(untouched):
    wrong = [
        update(untouched.number, value)
        for value in ("x", None, math.nan, math.inf, -math.inf, -1.0, 1e300, [], {}, True, [5.0])
    ]
    wrong += [update(untouched.choice, value) for value in ("no such", "", 5, None, ["silent"], math.nan)]
    wrong += [update(untouched.box, value) for value in (0, 1, "", None, "true", [])]
    wrong += [update(untouched.vector, value) for value in ([1.0, 2.0], [1.0, 2.0, math.nan], "abc", None, [[], 1, 2])]
    wrong += [update(untouched.number, "evil", name) for name in ("label", "visible", "_impl", "removed", "update_cb")]
    wrong += [{"type": "GuiUpdateMessage", "uuid": uuid, "updates": {"value": 1}} for uuid in ("", "nobody", 5, None)]
    wrong += [
        {"type": "GuiUpdateMessage", "uuid": untouched.number._impl.uuid, "updates": value} for value in (5, [], {})
    ]

    untouched.say(*wrong)

    assert untouched.state == (5.0, "silent", True, "seconds", 0)


@pytest.mark.parametrize("field", [name for name in CLICK if name != "type"])
@pytest.mark.parametrize(
    "value", [None, math.nan, [math.nan] * 3, [0.0] * 3, "x" * 100, [], {}, [1e300] * 3, [[[]]], -5]
)
def test_a_click_with_a_wrong_value_does_not_arrive(field, value):
    right = (field, value) in [("modifier", None), ("ray_origin", [0.0] * 3)]
    assert is_allowed(msgspec.msgpack.encode({**CLICK, field: value}), Role.STEER, {}) == right


@pytest.mark.parametrize("field", [name for name in CAMERA if name != "type"])
@pytest.mark.parametrize("value", [None, math.nan, [math.inf] * 3, "x", [], {}, -1.0, 1e300, True])
def test_a_camera_with_a_wrong_value_does_not_arrive(field, value):
    assert not is_allowed(msgspec.msgpack.encode({**CAMERA, field: value}), Role.STEER, {})


def test_fuzzed_messages_are_dropped_and_the_page_goes_on(untouched):
    rng = np.random.default_rng(11)
    kinds = [kind.__name__ for kind in viser._messages.Message.__subclasses__()]
    assert len(kinds) > 50

    def any_value(depth=0):
        simple = [None, True, -1, 2**63, 1e308, math.nan, "", "x" * 50, b"\xff" * 9, [], {}]
        deep = [[any_value(depth + 1)] * 3, {"a": any_value(depth + 1)}] if depth < 3 else [0]
        return [*simple, *deep][rng.integers(len(simple) + len(deep))]

    names = ["uuid", "name", "updates", "value", "wxyz", "position", "owner", "event_type", "transfer_uuid", "props"]
    for _ in range(15):
        batch = [rng.bytes(int(rng.integers(0, 200))) for _ in range(20)]
        batch += [
            {"type": kinds[rng.integers(len(kinds))], **{name: any_value() for name in rng.choice(names, 4)}}
            for _ in range(60)
        ]
        untouched.say(*batch, "text", b"", b"\x81" * 2000)
        untouched.vector.value = (0.5, 0.0, 0.0)
    assert untouched.state == (5.0, "silent", True, "seconds", 0)


def test_who_does_nothing_but_nonsense_is_disconnected_and_a_huge_message_too(guarded):
    async def nonsense(*messages):
        async with guarded.socket() as socket:
            for message in messages:
                await socket.send(message)
            while True:
                await socket.recv()

    for messages, code in (([b"nonsense"] * (MAX_REFUSED + 1), 1008), ([b"\x00" * 1_000_000], 1009)):
        with pytest.raises(ConnectionClosed) as closed:
            asyncio.run(asyncio.wait_for(nonsense(*messages), 20.0))
        assert closed.value.rcvd.code == code
    guarded.say()


# -------------------------------------------------------------------------------------------------- the addresses
def test_tokens_are_new_each_time_and_long():
    tokens = [token for _ in range(20) for token in PageAccess.by_token().roles]
    assert len(set(tokens)) == 40 and min(map(len, tokens)) >= 22


@pytest.mark.parametrize(
    ("host", "loopback"),
    [("127.0.0.1", True), ("127.8.8.8", True), ("::1", True), ("localhost", True), ("0.0.0.0", False), ("::", False),
     ("192.0.2.1", False), ("robot.example", False)],
)  # fmt: skip
def test_only_loopback_goes_without_a_token(host, loopback):
    assert is_loopback(host) is loopback
    if loopback:
        assert PageAccess.open(host).roles == {"": Role.STEER}
    else:
        with pytest.raises(ValueError, match="needs a token"):
            PageAccess.open(host)


def has_ipv6_loopback():
    try:
        with socket.create_server(("::1", 0), family=socket.AF_INET6):
            return True
    except OSError:
        return False


@pytest.mark.parametrize("host", ["127.0.0.1", "localhost", *(["::1"] if has_ipv6_loopback() else [])])
def test_a_page_can_be_served_at_every_loopback_interface(host):
    access = PageAccess.by_token(host)
    with page_server(PORT + 60, access) as server:
        address = access.address(server.get_port(), Role.WATCH)
        with urllib.request.urlopen(address, timeout=10.0) as answer:
            assert b"<html" in answer.read().lower()


def test_a_page_for_other_machines_knows_numbers_and_its_own_name_but_no_other():
    access = PageAccess.by_token("0.0.0.0")
    assert access.knows_host("192.0.2.7:8080") and access.knows_host("[2001:db8::1]:8080")
    assert not access.knows_host("evil.example:8080")


def test_without_tokens_the_origin_is_still_checked():
    access = PageAccess.open()
    with page_server(PORT + 40, access) as server:
        page = Guarded(server, access)
        assert page.page("/")[0] == 200
        page.say(update(page.number, 8.0))
        assert page.number.value == 8.0
        for how in ({"origin": "http://evil.example"}, {"host": "evil.example"}):
            with pytest.raises(InvalidStatus):
                asyncio.run(open_elsewhere(page, how))


async def open_elsewhere(page, how):
    async with page.socket(**how):
        pass
