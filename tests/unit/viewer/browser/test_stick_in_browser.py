"""The stick in a real browser: whatever may keep a release from the page lets it go, and only a new press takes it."""

import asyncio

import pytest

from mbf_abstract.access.page_access import PageAccess, Role
from terrain.viewer.live.session import SCRIPT
from terrain.viewer.server.page_server import page_server
from terrain.viewer.server.visitor_channel import VisitorChannel

pytestmark = pytest.mark.timeout(300)

PAD = "document.getElementById('mbf-stick')"
MIDDLE = f"(() => {{ const r = {PAD}.getBoundingClientRect(); return [r.x + r.width / 2, r.y + r.height / 2]; }})()"
HOLDS = f"{PAD}.firstChild.style.background === 'rgb(31, 111, 235)'"  # as the page shows it
META = 4
DEADLINE = 120.0  # s
SLOW_SOCKET = """(() => {
  const send = WebSocket.prototype.send;
  WebSocket.prototype.send = function (data) { this.sent = performance.now(); return send.call(this, data); };
  Object.defineProperty(WebSocket.prototype, 'bufferedAmount',
                        { get() { return performance.now() - this.sent < 50 ? 1 : 0; } });
})()"""  # what was sent needs 50 ms to leave, so that a report of the stick is left to the next heartbeat


class Noted:
    """Actions that note when the stick is taken and let go."""

    def __init__(self):
        self.looks = 0
        self.changes = []

    def hold_stick(self, visitor, turn, forward, beat):
        if self.changes[-1:] != ["held"]:
            self.changes.append("held")

    def release_stick(self, visitor):
        self.changes.append("let go")

    def look(self, visitor, view):
        self.looks += 1

    def point(self, visitor, place):
        pass

    def leave(self, visitor):
        pass


@pytest.fixture
def served():
    """The actions of a page with a stick, and its address."""
    access, channel = PageAccess.by_token(), VisitorChannel(SCRIPT.read_text("utf-8"))
    channel.actions = noted = Noted()
    with page_server(18770, access, channel=channel) as server:
        yield noted, access.address(server.get_port(), Role.STEER)


async def until(holds):
    async def poll():
        while not holds():
            await asyncio.sleep(0.01)

    await asyncio.wait_for(poll(), DEADLINE)


async def changes_so_far(page, noted):
    """What has happened to the stick by what the page shows now, with all that it has sent until now."""
    is_held = await page.evaluate(HOLDS)
    await until(lambda: (noted.changes[-1:] == ["held"]) == is_held)  # a report may wait for the next heartbeat
    looks = noted.looks
    await page.press("Free")  # messages come in their order
    await until(lambda: noted.looks > looks)
    return list(noted.changes)


async def mouse(page, kind, button):
    x, y = await page.evaluate(MIDDLE)
    await page.command("Input.dispatchMouseEvent", type=kind, x=x, y=y, button=button, clickCount=1)


def test_what_may_keep_a_release_from_the_page_lets_go_of_the_stick_and_only_a_new_press_takes_it(chromium, served):
    noted, address = served

    async def steer(page):
        await page.open(address)
        await page.wait_for(f"{PAD} !== null", DEADLINE)
        await page.evaluate(SLOW_SOCKET)
        await mouse(page, "mousePressed", "right")
        await mouse(page, "mouseReleased", "right")
        yield await changes_so_far(page, noted)
        await page.key_down(" ", "Space")
        await page.key_down("w", "KeyW")
        yield await changes_so_far(page, noted)
        await page.key_down("Meta", "MetaLeft", modifiers=META)
        await page.key_down(" ", "Space", repeat=True)
        yield await changes_so_far(page, noted)
        await page.key_up(" ", "Space")
        await page.key_down(" ", "Space")
        yield await changes_so_far(page, noted)
        await page.key_up(" ", "Space")
        await mouse(page, "mousePressed", "left")
        yield await changes_so_far(page, noted)
        await page.evaluate(f"{PAD}.dispatchEvent(new MouseEvent('contextmenu', {{bubbles: true}}))")
        yield await changes_so_far(page, noted)

    async def all_of_it(page):
        return [changes async for changes in steer(page)]

    by_right, by_keys, with_meta, anew, by_left, with_menu = chromium.visit(all_of_it)

    assert by_right == []
    assert by_keys == ["held"]
    assert with_meta == ["held", "let go"]
    assert anew == ["held", "let go", "held"]
    assert by_left == [*anew, "let go", "held"]
    assert with_menu == [*by_left, "let go"]
