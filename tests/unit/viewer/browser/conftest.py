"""A real browser: headless Chromium, driven over its DevTools port."""

import asyncio
import base64
import json
import os
import shutil
import subprocess
import tempfile
import urllib.request
from pathlib import Path

import pytest

FLAGS = (
    "--headless --no-sandbox --disable-gpu --disable-quic --no-first-run --disable-background-networking "
    "--disable-component-update --disable-sync --use-gl=angle --use-angle=swiftshader "
    "--enable-unsafe-swiftshader --window-size=1280,800 --remote-debugging-port=0"
).split()
START_TIMEOUT = 60.0


class Page:
    """One page: call its methods from a test; what the console says is kept in ``errors`` and ``requests``."""

    def __init__(self, websocket):
        self._websocket = websocket
        self._next_id = 0
        self.errors = []
        self.requests = []

    async def command(self, method, **params):
        """Send one DevTools command and return its result, noting events that come meanwhile."""
        self._next_id += 1
        await self._websocket.send(json.dumps({"id": self._next_id, "method": method, "params": params}))
        while True:
            message = json.loads(await self._websocket.recv())
            self._note(message)
            if message.get("id") == self._next_id:
                assert "error" not in message, message
                return message["result"]

    def _note(self, message):
        params = message.get("params", {})
        if message.get("method") == "Runtime.exceptionThrown":
            self.errors.append(
                params["exceptionDetails"].get("text", "") + str(params["exceptionDetails"].get("exception"))
            )
        elif message.get("method") == "Log.entryAdded" and params["entry"]["level"] == "error":
            self.errors.append(params["entry"]["text"])
        elif message.get("method") == "Network.requestWillBeSent":
            self.requests.append(params["request"]["url"])

    async def evaluate(self, expression):
        answer = await self.command("Runtime.evaluate", expression=expression, returnByValue=True, awaitPromise=True)
        return answer["result"].get("value")

    async def wait_for(self, expression, seconds=60.0):
        """Poll until a JavaScript expression is true; after so many seconds it names what never came."""
        try:
            await asyncio.wait_for(self._poll(expression), seconds)
        except asyncio.TimeoutError as error:  # not the built-in one before Python 3.11
            text = await self.evaluate("document.body.innerText")
            raise AssertionError(f"never true within {seconds:g} s: {expression}; the page shows: {text}") from error

    async def _poll(self, expression):
        while not await self.evaluate(expression):
            await asyncio.sleep(0.3)

    async def open(self, url):
        for domain in ("Page", "Runtime", "Log", "Network"):
            await self.command(f"{domain}.enable")
        await self.command("Page.navigate", url=url)

    async def move(self, x, y):
        """Move the pointer to a place of the window, in pixels."""
        await self.command("Input.dispatchMouseEvent", type="mouseMoved", x=x, y=y, button="none")

    async def click(self, x, y):
        """Press and release the left mouse button at a place of the window, in pixels."""
        for kind, button in (("mouseMoved", "none"), ("mousePressed", "left"), ("mouseReleased", "left")):
            await self.command("Input.dispatchMouseEvent", type=kind, x=x, y=y, button=button, clickCount=1)

    async def drag(self, start, end, modifiers=0):
        """Press the left mouse button at a place of the window, in pixels, and release it at another; 8 is Shift."""
        for kind, (x, y) in (
            ("mouseMoved", start),
            ("mousePressed", start),
            ("mouseMoved", end),
            ("mouseReleased", end),
        ):
            button = {"button": "none"} if kind == "mouseMoved" else {"button": "left", "clickCount": 1}
            await self.command("Input.dispatchMouseEvent", type=kind, x=x, y=y, modifiers=modifiers, **button)

    async def touch(self, kind, *places):
        """Fingers at places of the window, in pixels: all that are down after a touchStart, touchMove or touchEnd."""
        points = [{"x": x, "y": y, "id": finger} for finger, (x, y) in enumerate(places)]
        await self.command("Input.dispatchTouchEvent", type=kind, touchPoints=points)

    async def key(self, key):
        """Press and release a key, named as in JavaScript."""
        await self.key_down(key)
        await self.key_up(key)

    async def key_down(self, key, code="", modifiers=0, repeat=False):
        """Press a key and hold it; ``code`` names its place on the keyboard, as in JavaScript; 4 is Meta."""
        text = {"text": key} if len(key) == 1 else {}
        how = {"modifiers": modifiers, "autoRepeat": repeat, **text}
        await self.command("Input.dispatchKeyEvent", type="keyDown", key=key, code=code, **how)

    async def key_up(self, key, code=""):
        """Release a key."""
        await self.command("Input.dispatchKeyEvent", type="keyUp", key=key, code=code)

    async def resize(self, width, height):
        """Make the page as large as a window, or a phone's, of this size in pixels."""
        size = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": width < 600}
        await self.command("Emulation.setDeviceMetricsOverride", **size)

    async def press(self, label):
        """Press the button with this label, once it is there."""
        find = f"[...document.querySelectorAll('button')].find(b => b.textContent.trim() === {json.dumps(label)})"
        await self.wait_for(f"{find} !== undefined")
        await self.evaluate(f"{find}.click()")

    async def choose(self, label, option):
        """Choose an option of the list with this label."""
        name = f"[...document.querySelectorAll('label')].find(l => l.textContent.trim() === {json.dumps(label)})"
        chosen = (
            f"[...document.querySelectorAll('[role=option]')].find(o => o.textContent.trim() === {json.dumps(option)})"
        )
        await self.wait_for(f"{name} !== undefined")
        await self.evaluate(f"document.getElementById({name}.htmlFor).click()")
        await self.wait_for(f"{chosen} !== undefined")
        await self.evaluate(f"{chosen}.click()")

    async def read(self, text):
        """Wait until the page shows a text."""
        await self.wait_for(f"document.body.innerText.includes({json.dumps(text)})")

    async def screenshot(self):
        answer = await self.command("Page.captureScreenshot", format="png")
        return base64.b64decode(answer["data"])


class Chromium:
    """A browser process with a fresh profile."""

    def __init__(self, program):
        self._profile = tempfile.TemporaryDirectory(prefix="mbf_chromium_", ignore_cleanup_errors=True)
        self._process = subprocess.Popen(
            [program, *FLAGS, f"--user-data-dir={self._profile.name}", "about:blank"],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )

    def close(self):
        self._process.kill()
        self._process.wait()
        self._profile.cleanup()

    def visit(self, visit):
        """Run the coroutine ``visit(page)`` on a new page and return what it returns."""
        return asyncio.run(self._visit(visit))

    async def _visit(self, visit):
        import websockets

        port = await self._port()
        request = urllib.request.Request(f"http://127.0.0.1:{port}/json/new", method="PUT")
        with urllib.request.urlopen(request, timeout=START_TIMEOUT) as answer:
            address = json.load(answer)["webSocketDebuggerUrl"]
        async with websockets.connect(address, max_size=None) as websocket:
            return await visit(Page(websocket))

    async def _port(self):
        file = Path(self._profile.name) / "DevToolsActivePort"
        await asyncio.wait_for(_text_in(file), START_TIMEOUT)
        return int(file.read_text().split()[0])


async def _text_in(file):
    while not (file.is_file() and file.read_text().strip()):
        await asyncio.sleep(0.1)


@pytest.fixture(scope="module")
def chromium():
    program = os.environ.get("CHROMIUM") or shutil.which("chromium") or shutil.which("chromium-browser")
    if program is None:
        pytest.skip("no chromium on the path; install the package 'chromium' or set CHROMIUM")
    browser = Chromium(program)
    yield browser
    browser.close()
