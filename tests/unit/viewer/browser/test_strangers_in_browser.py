"""Another web page in the same browser cannot reach a page of a run, whatever it knows; the page itself can."""

import json
import threading
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

import pytest

from mbf_abstract.access.page_access import PageAccess, Role
from terrain.viewer.server.page_server import page_server

pytestmark = pytest.mark.timeout(300)

CONNECT = """new Promise(done => {{
  const socket = new WebSocket({address}, [{protocol}]);
  socket.onopen = () => done('open');
  socket.onerror = () => done('refused');
}})"""


class ForeignPage(BaseHTTPRequestHandler):
    """A web page of somebody else."""

    def do_GET(self):
        self.send_response(200)
        self.send_header("Content-Type", "text/html")
        self.end_headers()
        self.wfile.write(b"<html><body>come in</body></html>")

    def log_message(self, *arguments):
        pass


@pytest.fixture
def foreign_site():
    with ThreadingHTTPServer(("127.0.0.1", 0), ForeignPage) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield f"http://localhost:{server.server_port}/"
        server.shutdown()


def test_a_foreign_page_is_refused_even_with_the_token_and_the_own_page_is_not(chromium, foreign_site):
    import viser

    access = PageAccess.by_token()
    with page_server(18700, access) as server:
        address = access.address(server.get_port(), Role.STEER)
        socket = json.dumps(address.replace("http:", "ws:").rstrip("/"))
        connect = CONNECT.format(address=socket, protocol=json.dumps(f"viser-v{viser.__version__}"))

        async def from_elsewhere(page):
            await page.open(foreign_site)
            await page.read("come in")
            return await page.evaluate(connect), len(server.get_clients())

        async def from_the_page(page):
            await page.open(address)
            await page.wait_for("document.querySelector('canvas') !== null")
            return await page.evaluate(connect)

        assert chromium.visit(from_elsewhere) == ("refused", 0)
        assert chromium.visit(from_the_page) == "open"
