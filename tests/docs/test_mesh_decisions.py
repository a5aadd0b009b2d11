"""The page on mesh decisions names tests that exist, for all points of the list."""

import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PAGE = (ROOT / "docs" / "mesh_decisions.md").read_text("utf-8")


def test_every_sentence_of_the_page_is_a_test_of_the_file_it_names():
    named = re.findall(r"([\w ]+) \(`(test_\w+\.py)`\)", PAGE)
    files = {file.name: file.read_text("utf-8") for file in (ROOT / "tests").rglob("test_*.py")}

    assert len(named) > 40
    for sentence, file in named:
        assert f"def test_{sentence.strip().replace(' ', '_')}(" in files[file], f"{file}: {sentence}"


def test_all_eleven_points_are_answered():
    assert [int(number) for number in re.findall(r"^\| (\d+)\. ", PAGE, re.MULTILINE)] == list(range(1, 12))
