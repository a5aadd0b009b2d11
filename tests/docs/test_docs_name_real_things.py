"""Commands, keys, types and methods that the pages mention exist."""

import re
from pathlib import Path

import pytest

from mbf_abstract.config.navigation_parameters import NavigationParameters
from mbf_abstract.config.registry import PluginRegistry
from mbf_abstract.geometry import Path as GeometricPath
from mbf_abstract.geometry import Pose
from mbf_abstract.goals.handle import GoalHandle
from mbf_abstract.maps.map_queries import MapQueries
from mbf_abstract.navigator import Navigator
from mbf_abstract.outcomes import GetPathOutcome
from mbf_abstract.plugins import PlanRequest, PlanResult
from mbf_abstract.server.map_server import MapServer
from mbf_mesh_nav.plugins import MeshPlanner

DOCS = Path(__file__).resolve().parents[2] / "docs"
PAGES = sorted(page for page in DOCS.glob("*.md"))
TEXTS = "\n".join(page.read_text("utf-8") for page in PAGES)


def test_every_file_of_python_that_is_named_exists():
    folders = ("mbf_abstract", "mbf_costmap_nav", "mbf_mesh_nav", "terrain", "tests", "benchmarks", "examples", "docs")
    known = [f"/{file.relative_to(DOCS.parent)}" for name in folders for file in (DOCS.parent / name).rglob("*.py")]
    named = set(re.findall(r"`([\w/]+\.py)`", TEXTS + (DOCS.parent / "README.md").read_text("utf-8")))

    assert len(named) > 30
    assert [name for name in named if not any(file.endswith(f"/{name}") for file in known)] == []


@pytest.mark.parametrize("page", ["docs/concepts.md", "mkdocs.yml"])
def test_every_decision_is_listed_in_the_order_of_the_numbers(page):
    listed = re.findall(r"^ *- .*decisions/(\d{4}-.*\.md)\)?$", (DOCS.parent / page).read_text("utf-8"), re.MULTILINE)

    assert listed == [file.name for file in sorted((DOCS / "decisions").glob("*.md"))]


@pytest.mark.parametrize(
    ("pattern", "owner"),
    [
        (r"`navigator\.(?!server)(\w+)", Navigator),
        (r"`server\.(?!queries)(\w+)", MapServer),
        (r"`server\.queries\.(\w+)", MapQueries),
        (r"`handle\.(\w+)", GoalHandle),
    ],
)
def test_every_method_that_is_named_exists(pattern, owner):
    named = set(re.findall(pattern, TEXTS))

    assert named and [name for name in named if not hasattr(owner, name)] == []


def test_every_plugin_type_of_the_name_tables_is_registered():
    entries = {entry.name for entry in PluginRegistry().entries()}
    named = set(re.findall(r"`((?:costmap|mesh)\.[a-z_]+)`", (DOCS / "coming_from.md").read_text("utf-8")))

    assert len(named) > 10 and named <= entries


def test_every_parameter_of_the_name_tables_exists():
    """The right-hand names of the move_base table that look like navigation parameters."""
    kept = re.findall(r"`([a-z]+_[a-z_]+)`.*\| the same", (DOCS / "coming_from.md").read_text("utf-8"))
    table = [name for name in kept if name.startswith(("planner_", "controller_", "oscillation_", "shutdown_"))]

    assert table and set(table) <= set(NavigationParameters.model_fields)


def test_the_planner_of_the_readme_plans():
    """The listing has no imports, so that it is short; these are the names it needs."""
    text = (DOCS.parent / "README.md").read_text("utf-8")
    listing = next(block for block in re.findall(r"```python\n(.*?)```", text, re.DOTALL) if "(MeshPlanner)" in block)
    names = {
        "MeshPlanner": MeshPlanner, "PlanRequest": PlanRequest, "PlanResult": PlanResult, "Path": GeometricPath,
        "GetPathOutcome": GetPathOutcome,
    }  # fmt: skip
    exec(listing, names)

    result = names["StraightLine"].make_plan(None, PlanRequest(Pose.planar(0.0, 0.0), Pose.planar(3.0, 4.0, 1.0)))

    assert result.success and result.path.length == pytest.approx(5.0)
    assert len(listing.splitlines()) < 20
