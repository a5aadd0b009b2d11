"""The page of results: tables of what holds today, each with its command and commit; what was goes to the history."""

import re
from pathlib import Path

import pytest

PAGE = (Path(__file__).parents[2] / "docs" / "results.md").read_text("utf-8")
SECTIONS = dict(zip(*[iter(re.split(r"(?m)^## (.*)$", PAGE)[1:])] * 2, strict=True))
COMMIT = re.compile(r"\b[0-9a-f]{7,8}\b")
LONGEST_ROW = 260  # characters
LONGEST_TEXT = 4  # lines between two tables


@pytest.mark.parametrize("title", SECTIONS)
def test_every_section_names_a_command_and_a_commit(title):
    text = SECTIONS[title]
    assert COMMIT.search(text)
    assert re.search(r"`[^`]*(python|pytest|mbf|pip|find|\.ci/)[^`]*`", text)


def test_a_row_is_one_figure_and_not_a_story():
    rows = [line for line in PAGE.splitlines() if line.startswith("|")]
    assert len(rows) > 200
    assert not [row for row in rows if len(row) > LONGEST_ROW]
    assert not [row for row in rows if re.search(r"\. [A-Z][a-z]+ [a-z]", row)], "a second sentence"


def test_what_stands_between_tables_is_short():
    blocks = [block for text in SECTIONS.values() for block in re.split(r"\n\s*\n", text)]
    texts = [block for block in blocks if block.strip() and not block.lstrip().startswith(("|", "!", "#"))]
    assert len(texts) > 30
    assert not [text for text in texts if len(text.strip().splitlines()) > LONGEST_TEXT]


def test_no_figure_is_told_from_one_that_was_before_it():
    assert not re.findall(r"(?m)^\| the same again.*$", PAGE)
    assert len(PAGE.splitlines()) < 750, "move what does not hold any more to docs/decisions/0040"
