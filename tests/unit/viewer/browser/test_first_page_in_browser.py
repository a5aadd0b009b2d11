"""The documentation's first page, as built: small, from one host, still while it loads; its replay drawn, at rest."""

import gzip
import os
import subprocess
import sys
import threading
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[4]
MOST_BYTES = 600_000  # with gzip, the index of the search among them
MOST_REQUESTS = 16
GOOD_SHIFT = 0.1  # cumulative layout shift that web.dev calls good
REPLAY = "document.querySelector('iframe.replay').contentWindow.replay"
SHIFTS = """(async () => {
  let sum = 0;
  new PerformanceObserver(list => { for (const one of list.getEntries()) sum += one.hadRecentInput ? 0 : one.value; })
    .observe({type: 'layout-shift', buffered: true});
  for (let k = 0; k < 3; k++) await new Promise(requestAnimationFrame);
  return sum; })()"""


class Quiet(SimpleHTTPRequestHandler):
    def log_message(self, *arguments):
        pass


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """The folder of the built documentation: that of .ci/run, or one built here."""
    if "MBF_SITE" in os.environ:
        return Path(os.environ["MBF_SITE"])
    pytest.importorskip("mkdocs", reason="needs the extra 'dev', which has mkdocs")
    folder = tmp_path_factory.mktemp("documentation") / "site"
    build = [sys.executable, "-m", "mkdocs", "build", "--quiet", "--config-file", ROOT / "mkdocs.yml"]
    subprocess.run([*build, "--site-dir", folder], check=True)
    return folder


@pytest.fixture
def address(site):
    with ThreadingHTTPServer(("127.0.0.1", 0), partial(Quiet, directory=site)) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield f"http://127.0.0.1:{server.server_port}/"
        server.shutdown()


@pytest.mark.timeout(180)
@pytest.mark.parametrize("size", [(1280, 800), (390, 844)], ids=["desktop", "phone"])
def test_the_first_page_is_small_from_one_host_and_does_not_move_while_it_loads(
    chromium, site, address, tmp_path, size
):
    async def watch(page):
        await page.resize(*size)
        await page.open(address)
        await page.wait_for("document.readyState === 'complete'")
        await page.evaluate("document.querySelector('iframe.replay').scrollIntoView()")
        await page.wait_for(f"{REPLAY} !== undefined && {REPLAY}.used !== undefined && !{REPLAY}.coarse")
        playing = await page.evaluate(f"{REPLAY}.player.playing")
        wide = await page.evaluate("document.documentElement.scrollWidth")
        return page.errors, page.requests, playing, wide, await page.evaluate(SHIFTS), await page.screenshot()

    errors, requests, playing, wide, shift, png = chromium.visit(watch)

    (tmp_path / "screenshot.png").write_bytes(png)
    assert errors == []
    assert [url for url in requests if not url.startswith((address, "data:", "blob:"))] == []
    files = [site / url.removeprefix(address).partition("?")[0] for url in requests if url.startswith(address)]
    files = {file / "index.html" if file.is_dir() else file for file in files}
    assert len(files) <= MOST_REQUESTS
    assert sum(len(gzip.compress(file.read_bytes())) for file in files) < MOST_BYTES
    assert not playing, "no graphics card here: the page stays usable, the replay waits to be played"
    assert wide <= size[0]
    assert shift < GOOD_SHIFT
