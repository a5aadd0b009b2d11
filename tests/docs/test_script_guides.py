"""The blocks of the guides for scripts and executives run as they stand, one after the other."""

import re
from pathlib import Path

import pytest

from terrain.session.session import Session, SessionOptions

DOCS = Path(__file__).resolve().parents[2] / "docs"
LISTING = re.compile(r"<!-- listing: \S+ -->\n```python\n.*?\n```\n", re.DOTALL)


def blocks_of(page):
    """The Python blocks of a page but for listings, which are files with tests of their own."""
    return re.findall(r"```python\n(.*?)```", LISTING.sub("", (DOCS / page).read_text("utf-8")), re.DOTALL)


def run_block(page, number, code, names):
    exec(compile(code, f"{page}, block {number}", "exec"), names)


@pytest.mark.timeout(300)  # kernels are compiled on a machine that has none
def test_the_blocks_of_the_page_about_goals_run_in_one_session(capsys):
    first, *others = blocks_of("goals.md")
    names = {}
    run_block("goals.md", 0, first, names)
    with Session("indoor", SessionOptions(backend="costmap")) as session:
        names |= {"session": session, "navigator": session.navigator}
        for number, code in enumerate(others, start=1):
            run_block("goals.md", number, code, names)
    assert "waypoint 2 at" in capsys.readouterr().out


@pytest.mark.timeout(300)
def test_the_trees_of_the_page_about_executives_drive_and_its_node_ticks():
    names = {}
    for number, code in enumerate(blocks_of("executives.md")):
        run_block("executives.md", number, code, names)
    node = names["NearerThan"]("nearer?", 100.0)
    mission = names["result"].mission
    node.setup(mission=mission)
    assert (names["result"].success, node.update()) == (True, names["Status"].SUCCESS)
