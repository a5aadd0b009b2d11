"""The page on other projects' tests names every fact once, tested or left out, as the tests have them."""

import ast
import csv
import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PAGE = (ROOT / "docs" / "upstream_tests.md").read_text("utf-8")
ALL = frozenset(range(1, 358))

# A fact may have a letter, for a case of it; a hash goes on with four digits or letters at least.
ONE = re.compile(r"(?<![A-Za-z0-9])[Ff](\d{3})(?!\d|[a-f][0-9a-f]{4})")
RANGE = re.compile(r"[Ff](\d{3})(?:-|_to_)[Ff](\d{3})")


def numbers(text):
    """Numbers of the facts that a text names, one by one or as a range."""
    named = {int(number) for number in ONE.findall(text)}
    return named.union(*(range(int(first), int(last) + 1) for first, last in RANGE.findall(text)))


def without_its_docstring(source):
    """A module's text without its docstring: what that sums up is not tested by it."""
    body = ast.parse(source).body
    if body and isinstance(body[0], ast.Expr) and isinstance(body[0].value, ast.Constant):
        lines = source.splitlines()
        return "\n".join(lines[: body[0].lineno - 1] + lines[body[0].end_lineno :])
    return source


def section(title):
    """Cells of the table below a heading, row by row."""
    lines = PAGE.split(f"## {title}\n")[1].split("\n## ")[0].splitlines()
    rows = [line for line in lines if line.startswith("| ")][1:]
    return [[cell.strip() for cell in row.strip("|").split(" | ")] for row in rows]


def cited():
    """Files that cite each fact."""
    files = {}
    for file in sorted((ROOT / "tests").rglob("*.py")):
        for number in numbers(without_its_docstring(file.read_text("utf-8"))) & ALL:
            files.setdefault(number, set()).add(file.name)
    return files


def test_each_group_has_as_many_facts_in_the_files_it_names_as_the_page_says():
    files, covered = cited(), []
    for name, _, facts, tested, where in section("Tested"):
        here = sorted(numbers(facts))
        covered += here
        found = [number for number in here if number in files]
        assert tested == f"{len(found)} of {len(here)}", name
        assert set(re.findall(r"`(\w+\.py)`", where)) == set().union(*(files[number] for number in found)), name
    assert covered == sorted(ALL)


def test_what_is_left_out_is_all_that_no_test_cites():
    left_out = [number for facts, _ in section("Left out") for number in sorted(numbers(facts))]
    assert left_out == sorted(ALL - cited().keys())
    counts = re.search(r"as (\d+) numbered facts.* (\d+) of them are tested here, (\d+) are left out", PAGE, re.DOTALL)
    assert [int(count) for count in counts.groups()] == [len(ALL), len(ALL) - len(left_out), len(left_out)]


def test_an_answer_that_differs_is_one_that_is_tested():
    differing = [number for facts, *_ in section("Where our answer differs on purpose") for number in numbers(facts)]
    assert differing and set(differing) <= cited().keys()


def test_the_groups_are_those_of_the_collected_facts(shared_data):
    with open(shared_data / "peer_facts.csv", encoding="utf-8") as file:
        groups = {int(row["id"][1:]): row["group"].split(" (")[0] for row in csv.DictReader(file)}
    assert groups.keys() == ALL
    assert {number: name for name, _, facts, *_ in section("Tested") for number in numbers(facts)} == groups
