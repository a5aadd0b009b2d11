"""The replay on the first page of the documentation is small, of the stated size, and made by the present code."""

import re
from pathlib import Path

from terrain.viewer.replay.replay_page import PAGE

DOCS = Path(__file__).resolve().parents[2] / "docs"
MOST = 150_000  # bytes


def test_the_first_page_embeds_a_small_replay_and_states_its_size():
    index = (DOCS / "index.md").read_text("utf-8")
    replay = DOCS / re.search(r'<iframe [^>]*src="([^"]+)"', index)[1]

    size = replay.stat().st_size
    assert size < MOST
    assert int(re.search(r"(\d+) kB", index)[1]) == round(size / 1000)


def has(text, file):
    """Whether a page has all of a file of its template, but for the places that are filled in."""
    return all(part in text for part in re.split(r"\{\{\w+\}\}", file.read_text("utf-8").rstrip()))


def test_it_is_made_by_the_present_code():
    text = (DOCS / "replays" / "garage_roof.html").read_text("utf-8")

    old = [file.name for file in sorted(PAGE.iterdir()) if file.is_file() and not has(text, file)]
    assert old == [], "run: python docs/make_pictures.py garage_roof"
