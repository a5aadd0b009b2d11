"""How soon the documentation's first page can be used: Lighthouse, beside a bare page of the same theme.

    python benchmarks/first_page.py [--quick] [--json]

Needs Chromium, Node.js, and what the extra ``dev`` installs. The site is built and served from this machine, with gzip
as any host does; Lighthouse (fetched by npx) loads it as a phone on slow 4G with a processor four times slower, and as
a desktop. The peer is a site with one short page: what Material for MkDocs takes alone. Both are loaded by turns; the
figures are medians. Without a graphics card the replay on the page is drawn by the processor, which is the worst case.
``--json`` prints the figures as last line.
"""

from __future__ import annotations

import argparse
import gzip
import json
import os
import shutil
import statistics
import subprocess
import sys
import tempfile
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

from mbf_abstract.time.program_end import interruptible

ROOT = Path(__file__).resolve().parents[1]
LIGHTHOUSE = "lighthouse@12.8.2"
AUDITS = {
    "first-contentful-paint": "first_paint_ms",
    "interactive": "interactive_ms",
    "total-blocking-time": "blocked_ms",
    "cumulative-layout-shift": "layout_shift",
    "total-byte-weight": "bytes",
}
CATEGORIES = ("accessibility", "best-practices")
BARE = "site_name: Bare\ntheme: {name: material, font: false}\nplugins: [search]\n"
COMPRESSED = (".html", ".css", ".js", ".json", ".svg")

Figures = dict[str, float]


class Compressing(SimpleHTTPRequestHandler):
    """Serves a folder with gzip."""

    def do_GET(self) -> None:
        """Answer with a file, compressed where that helps."""
        file = Path(self.translate_path(self.path))
        file = file / "index.html" if file.is_dir() else file
        if file.suffix not in COMPRESSED or not file.is_file():
            super().do_GET()
            return
        content = gzip.compress(file.read_bytes())
        self.send_response(200)
        self.send_header("Content-Type", self.guess_type(str(file)))
        self.send_header("Content-Encoding", "gzip")
        self.send_header("Content-Length", str(len(content)))
        self.end_headers()
        self.wfile.write(content)

    def log_message(self, format: str, *arguments: object) -> None:
        """Print nothing."""


@contextmanager
def served(folder: Path) -> Iterator[str]:
    """Serve a folder; yields its address."""
    with ThreadingHTTPServer(("127.0.0.1", 0), partial(Compressing, directory=folder)) as server:
        thread = threading.Thread(target=server.serve_forever)
        thread.start()
        try:
            yield f"http://127.0.0.1:{server.server_port}/"
        finally:
            server.shutdown()
            thread.join()


def build(config: Path, site: Path) -> None:
    """Build a site with mkdocs."""
    subprocess.run(
        [sys.executable, "-m", "mkdocs", "build", "--quiet", "--config-file", str(config), "--site-dir", str(site)],
        check=True,
        env={**os.environ, "NO_MKDOCS_2_WARNING": "1"},
    )


def lighthouse(address: str, device: str, chromium: str) -> Figures:
    """Load a page once; raises RuntimeError with what Lighthouse printed if it could not."""
    preset = ["--preset=desktop"] if device == "desktop" else []
    flags = "--chrome-flags=--headless --no-sandbox --disable-gpu"
    command = ["npx", "--yes", LIGHTHOUSE, address, *preset, "--quiet", "--output=json", flags]
    done = subprocess.run(
        command, capture_output=True, text=True, env={**os.environ, "CHROME_PATH": chromium}, check=False
    )
    if done.returncode:
        raise RuntimeError(f"{' '.join(command)}: {done.stderr.strip()[-2000:]}")
    report = json.loads(done.stdout)
    figures = {name: float(report["audits"][audit]["numericValue"]) for audit, name in AUDITS.items()}
    return figures | {name: 100.0 * report["categories"][name]["score"] for name in CATEGORIES}


def measure(turns: int, chromium: str) -> dict[str, dict[str, Figures]]:
    """Return the medians of both pages on both devices."""
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        (folder / "docs").mkdir()
        (folder / "docs" / "index.md").write_text("# Bare\n\nOne short page.\n")
        (folder / "mkdocs.yml").write_text(BARE)
        build(ROOT / "mkdocs.yml", folder / "ours")
        build(folder / "mkdocs.yml", folder / "bare")
        with served(folder / "ours") as ours, served(folder / "bare") as bare:
            pages = {"ours": ours, "bare": bare}
            return {device: _by_turns(pages, device, turns, chromium) for device in ("phone", "desktop")}


def _by_turns(pages: dict[str, str], device: str, turns: int, chromium: str) -> dict[str, Figures]:
    loaded: dict[str, list[Figures]] = {name: [] for name in pages}
    for turn in range(turns):
        for name in pages if turn % 2 else reversed(pages):
            loaded[name].append(lighthouse(pages[name], device, chromium))
    return {name: {key: statistics.median(one[key] for one in of) for key in of[0]} for name, of in loaded.items()}


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="One load of each page instead of three.")
    parser.add_argument("--json", action="store_true", help="Print the figures as last line.")
    options = parser.parse_args()
    chromium = os.environ.get("CHROMIUM") or shutil.which("chromium") or shutil.which("chromium-browser")
    if chromium is None or shutil.which("npx") is None:
        raise SystemExit("first_page.py needs Chromium (on the path, or named by CHROMIUM) and Node.js with npx")
    found = measure(1 if options.quick else 3, chromium)
    for device, pages in found.items():
        print(device)
        for key in (*AUDITS.values(), *CATEGORIES):
            ours, bare = (pages[name][key] for name in ("ours", "bare"))
            ratio = f"{ours / bare:8.2f} x" if bare else ""
            print(f"  {key:16s} {ours:12.2f} {bare:12.2f} {ratio}")
    if options.json:
        print(json.dumps(found))


if __name__ == "__main__":
    with interruptible():
        main()
