"""Print pip constraints that pin every requirement of pyproject.toml, extras included, to the lowest version it names.

Only such a requirement has a lowest version: ``name>=version``, perhaps with a marker. Needs Python >= 3.11 (tomllib).
"""

import re
import sys
from itertools import chain
from pathlib import Path

import tomllib

OWN_EXTRAS = re.compile(r"mbf-flex\[")
BOUNDED = re.compile(r"(?P<name>[\w.-]+)(?:\[[\w,-]+\])?>=(?P<version>[\w.]+)(?P<marker>\s*;.*)?")


def lowest_versions(pyproject: str) -> dict[str, str]:
    """Return name -> ``version; marker`` of every requirement, from the text of a pyproject.toml.

    Raises
    ------
    ValueError
        A requirement has no lower bound, or two different ones.
    """
    project = tomllib.loads(pyproject)["project"]
    groups = [project["dependencies"], *project["optional-dependencies"].values()]
    lowest: dict[str, str] = {}
    for requirement in chain.from_iterable(groups):
        if OWN_EXTRAS.match(requirement):
            continue
        match = BOUNDED.fullmatch(requirement)
        if match is None:
            raise ValueError(f"pyproject.toml: expected 'name>=version', got '{requirement}'")
        version = match["version"] + (match["marker"] or "")
        if lowest.setdefault(match["name"], version) != version:
            raise ValueError(f"pyproject.toml: '{match['name']}' has the bounds {lowest[match['name']]} and {version}")
    return lowest


if __name__ == "__main__":
    text = (Path(__file__).parent.parent / "pyproject.toml").read_text(encoding="utf-8")
    for name, version in lowest_versions(text).items():
        sys.stdout.write(f"{name}=={version}\n")
