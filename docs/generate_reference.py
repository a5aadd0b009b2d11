"""Write the parts of the documentation that come from the code, so that they cannot say anything else.

    python docs/generate_reference.py            write all of them
    python docs/generate_reference.py --check    write nothing; exit code 1 and the names of pages that are out of date

Written are ``configuration*.md`` (every parameter of every model), ``scenario_reference.md`` (every key of a scenario),
``commands.md`` (every command of ``mbf``), the example plugins (what ``mbf new`` writes), the listings in the guides
(the text of the example files), the table of metrics in ``verdict.md``, that of a robot's keys in ``your_robot.md``,
tables of parameter models that a page names, and the table of ``faults_and_promises.md`` (the docstrings of
``tests/faults``).
"""

from __future__ import annotations

import argparse
import ast
import importlib
import inspect
import re
import sys
from pathlib import Path

from command_tables import commands_page
from parameter_tables import configuration_pages, parameter_table
from scenario_tables import scenario_page

from mbf_abstract.commands.new import plugin_source
from terrain.description.parameters import UrdfRobot
from terrain.recording.metrics import Metrics

DOCS = Path(__file__).resolve().parent
REPOSITORY = DOCS.parent

EXAMPLES = {
    "straight_on_mesh": ("planner", "mesh"),
    "straight_on_costmap": ("planner", "costmap"),
    "chase_on_mesh": ("controller", "mesh"),
    "chase_on_costmap": ("controller", "costmap"),
    "follow_carrot": ("controller", ""),
    "look_around": ("recovery", ""),
    "dense_poses": ("refiner", ""),
    "flooded_ground": ("layer", "mesh"),
    "wet_floor": ("layer", "costmap"),
}
"""Example plugins that are what ``mbf new`` writes: module -> kind and map; without a map they run on every one."""

LISTING = re.compile(r"(<!-- listing: (?P<file>\S+) -->\n)(?:```python\n.*?\n```\n)?", re.DOTALL)
TABLE = re.compile(r"(<!-- table: tests/faults -->\n)(?:\|.*\n)*")
METRICS = re.compile(r"(<!-- table: metrics -->\n)(?:\|.*\n)*")
ROBOT = re.compile(r"(<!-- table: robot -->\n)(?:\|.*\n)*")
MODEL = re.compile(r"(<!-- table: (?P<module>[\w.]+):(?P<name>\w+) -->\n)(?:\|.*\n)*")
METRIC = re.compile(r"^(?P<names>\w[\w, ]*) : .*\n(?P<text>(?: {4}.*\n?)+)", re.MULTILINE)
FAULT_ROW = re.compile(r"Fault table, rows? (?P<rows>[\d, and]+)[^:]*: (?P<text>.+)", re.DOTALL)


def generate() -> dict[Path, str]:
    """Return every generated file with the text it should have."""
    texts = {DOCS / name: text for name, text in configuration_pages().items()}
    texts |= {DOCS / "scenario_reference.md": scenario_page(), DOCS / "commands.md": commands_page()}
    for name, (kind, map_name) in EXAMPLES.items():
        texts[REPOSITORY / "examples" / "plugins" / f"{name}.py"] = plugin_source(kind, name, map_name)
    for page in sorted(DOCS.glob("*.md")):
        if page not in texts:
            text = LISTING.sub(lambda match: _listing(match, texts), page.read_text(encoding="utf-8"))
            text = TABLE.sub(lambda match: match[1] + fault_table(), text)
            text = MODEL.sub(_model_table, text)
            text = ROBOT.sub(lambda match: match[1] + parameter_table(UrdfRobot, dynamic=False), text)
            texts[page] = METRICS.sub(lambda match: match[1] + metrics_table(), text)
    return texts


def metrics_table() -> str:
    """Return a table of the metrics that a recording holds, from the docstring of their model."""
    text = inspect.getdoc(Metrics) or ""
    rows = ["| name | meaning |", "|---|---|"]
    for match in METRIC.finditer(text.partition("----------\n")[2]):
        names = ", ".join(f"`{name}`" for name in match["names"].split(", "))
        rows.append(f"| {names} | {' '.join(match['text'].replace('``', '`').split())} |")
    return "\n".join(rows) + "\n"


def _listing(match: re.Match[str], texts: dict[Path, str]) -> str:
    """Put the text of the named file below its marker."""
    file = REPOSITORY / match["file"]
    source = texts.get(file) or file.read_text(encoding="utf-8")
    return f"{match[1]}```python\n{source.rstrip()}\n```\n"


def _model_table(match: re.Match[str]) -> str:
    """Put the table of the named parameter model below its marker."""
    model = getattr(importlib.import_module(match["module"]), match["name"])
    return match[1] + parameter_table(model, dynamic=False)


def fault_table() -> str:
    """Return a table of the fault tests: row of the fault table, fault, what the tests show, file."""
    rows = []
    for file in sorted((REPOSITORY / "tests" / "faults").glob("test_*.py")):
        tree = ast.parse(file.read_text(encoding="utf-8"))
        match = FAULT_ROW.match(ast.get_docstring(tree) or "")
        if match is None:
            raise ValueError(f"the docstring of {file.name} must begin with 'Fault table, row N: ...'")
        fault = " ".join(match["text"].partition("\n\n")[0].split())
        names = [node.name for node in tree.body if isinstance(node, ast.FunctionDef) and node.name[:5] == "test_"]
        shown = "<br>".join(name.removeprefix("test_").replace("_", " ") for name in names)
        first_row = int(match["rows"].replace(",", " ").split()[0])
        rows.append((first_row, f"| {match['rows'].strip(', ')} | {fault} | {shown} | `{file.name}` |"))
    lines = ["| row | fault | what the tests show | file |", "|---|---|---|---|", *(line for _, line in sorted(rows))]
    return "\n".join(lines) + "\n"


def main() -> int:
    """Write or check all generated files."""
    parser = argparse.ArgumentParser(description="Generate the documentation's parts that come from the code.")
    parser.add_argument("--check", action="store_true", help="write nothing, list what is out of date")
    check = parser.parse_args().check
    old = [file for file, text in generate().items() if not file.is_file() or file.read_text("utf-8") != text]
    for file in old:
        sys.stdout.write(f"{'out of date' if check else 'written'}: {file.relative_to(REPOSITORY)}\n")
    if not check:
        for file, text in generate().items():
            file.write_text(text, encoding="utf-8")
    return 1 if check and old else 0


if __name__ == "__main__":
    sys.exit(main())
