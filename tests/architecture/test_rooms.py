"""The rooms and arrows of the design, checked by parsing every module; each test names all offenders of one rule."""

import ast
from collections import Counter
from functools import cache
from pathlib import Path

import networkx
import pytest

REPOSITORY = Path(__file__).resolve().parents[2]
ALLOWED = {
    "mbf_abstract": {"mbf_abstract"},
    "mbf_costmap_nav": {"mbf_abstract", "mbf_costmap_nav"},
    "mbf_mesh_nav": {"mbf_abstract", "mbf_mesh_nav"},
    "mbf_ros": {"mbf_abstract", "mbf_ros"},
    "terrain": {"mbf_abstract", "terrain"},
}
CLOCKS = "mbf_abstract/time/"
SPAWNERS = (
    "mbf_abstract/access/",
    "mbf_abstract/execution/",
    "mbf_abstract/drive/",
    "mbf_abstract/goals/",
    "mbf_abstract/server/process_end.py",
    "mbf_abstract/server/warm_up.py",
    "mbf_abstract/testing/",
    "mbf_ros/ros2/",
    "mbf_ros/rosbridge/",
    "mbf_ros/rosbridge_robot/",
    "terrain/",
)
SEEDED = {"np.random.default_rng", "np.random.Generator", "np.random.SeedSequence"}
VIEWS = {"matplotlib", "viser", "rich", "typer", "PIL"}
SIMULATOR = {
    "pybullet",
    "pybullet_data",
    "pybullet_utils",
    "matplotlib",
    "viser",
    "embreex",
    "mcap",
    "foxglove_schemas_protobuf",
}
PLUGIN_ROOMS = {"planners", "controllers", "recoveries", "refiners"}
ALGORITHM_ROOMS = PLUGIN_ROOMS | {"kernels", "layers", "execution", "actions"}
UNSAFE_CALLS = {"yaml.load", "yaml.unsafe_load", "eval", "exec", "os.system"}
MOST_MODULES = 16  # in a room at one level, its __init__ not counted
WANTED_LINES, MOST_LINES, MOST_LINES_OF_A_FUNCTION, MOST_LINES_OF_A_KERNEL = 250, 360, 60, 100
LONG_FILES = Path(__file__).with_name("long_files.txt")
"""Files from before the rule; nothing is added to them."""
FILES = {
    file.relative_to(REPOSITORY).as_posix(): file
    for package in ALLOWED
    for file in sorted((REPOSITORY / package).rglob("*.py"))
}


def module_of(name):
    """Dotted name of a file; that of its folder for an ``__init__``."""
    return name.removesuffix(".py").removesuffix("/__init__").replace("/", ".")


MODULES = {module_of(name): name for name in FILES}


@cache
def tree_of(name):
    return ast.parse(FILES[name].read_text("utf-8"), name)


@cache
def imports(name):
    """Every imported module of a file with its line, wherever it stands, under TYPE_CHECKING too."""
    return list(_imports(tree_of(name)))


def _imports(tree):
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from ((alias.name, node.lineno) for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            for alias in node.names:
                submodule = f"{node.module}.{alias.name}"
                yield submodule if submodule in MODULES else node.module, node.lineno


@cache
def calls(name):
    """Dotted names of everything that a file calls, with the line."""
    return [(ast.unparse(n.func), n.lineno) for n in ast.walk(tree_of(name)) if isinstance(n, ast.Call)]


def offenders(found):
    """Text that names each offender on a line of its own."""
    return "\n" + "\n".join(f"  {name}:{line} {what}" for name, line, what in found)


def assert_none(found):
    found = list(found)
    assert not found, offenders(found)


def test_a_package_imports_only_what_the_design_allows():
    assert_none(
        (name, line, module)
        for name in FILES
        for module, line in imports(name)
        if module.split(".")[0] in ALLOWED and module.split(".")[0] not in ALLOWED[name.split("/")[0]]
    )


def test_no_imports_run_in_a_circle_not_even_for_types():
    graph = networkx.DiGraph()
    for name in FILES:
        here = module_of(name)
        graph.add_edges_from((here, module) for module, _ in imports(name) if module in MODULES and module != here)
    circles = [sorted(group) for group in networkx.strongly_connected_components(graph) if len(group) > 1]
    assert not circles


def test_no_room_has_more_modules_than_one_can_overlook():
    sizes = Counter(str(Path(name).parent) for name in FILES if not name.endswith("__init__.py"))
    assert {room: size for room, size in sizes.items() if size > MOST_MODULES} == {}


def test_only_the_clocks_read_the_time_and_make_threads():
    elsewhere = [name for name in FILES if not name.startswith(CLOCKS)]
    assert_none((name, line, module) for name in elsewhere for module, line in imports(name) if module == "time")
    threads = {"threading.Thread", "Thread", "threading.Timer"}
    assert_none((name, line, call) for name in elsewhere for call, line in calls(name) if call in threads)


def test_threads_start_only_where_something_is_run():
    assert_none(
        (name, line, call)
        for name in FILES
        if not name.startswith((*SPAWNERS, CLOCKS))
        for call, line in calls(name)
        if call.endswith(".spawn")
    )


def test_random_numbers_come_from_seeded_generators():
    assert_none(
        (name, line, call)
        for name in FILES
        for call, line in calls(name)
        if call.startswith(("np.random.", "random.")) and call not in SEEDED
    )


def test_nothing_unsafe_is_called():
    assert_none((name, line, module) for name in FILES for module, line in imports(name) if module == "pickle")
    assert_none((name, line, call) for name in FILES for call, line in calls(name) if call in UNSAFE_CALLS)


def test_views_stay_out_of_algorithms():
    assert_none(
        (name, line, module)
        for name in FILES
        if ALGORITHM_ROOMS & set(name.split("/"))
        for module, line in imports(name)
        if module.split(".")[0] in VIEWS
    )


def test_sessions_and_scenarios_know_no_viewer_and_no_command():
    """Outputs are passed in by whoever runs them."""
    outputs = ("terrain.viewer.", "terrain.commands.", "mbf_abstract.commands.")
    assert_none(
        (name, line, module)
        for name in FILES
        if name.startswith(("terrain/session/", "terrain/scenarios/"))
        for module, line in imports(name)
        if f"{module}.".startswith(outputs)
    )


def test_plugins_know_no_server_no_action_and_no_other_plugin():
    assert_none(
        (name, line, module)
        for name in FILES
        if name.split("/")[1] in PLUGIN_ROOMS and not name.endswith("__init__.py")
        for module, line in imports(name)
        if {"server", "actions"} & set(module.split(".")) or is_plugin(module)
    )


def is_plugin(module):
    """Whether a module of ours lies in a room of plugins."""
    parts = module.split(".")
    return parts[0] in ALLOWED and len(parts) > 2 and parts[1] in PLUGIN_ROOMS


def test_the_plain_packages_import_no_simulator_and_nothing_that_draws():
    assert_none(
        (name, line, module)
        for name in FILES
        if not name.startswith("terrain/")
        for module, line in imports(name)
        if module.split(".")[0] in SIMULATOR
    )


def test_files_have_at_most_250_lines_but_for_a_list_that_only_shrinks():
    lengths = {name: len(file.read_text("utf-8").splitlines()) for name, file in FILES.items()}
    listed = set(LONG_FILES.read_text("utf-8").split())
    long = {name for name, lines in lengths.items() if lines > WANTED_LINES}
    assert long - listed == set(), "longer than they may be: split them where they have two subjects"
    assert listed - long == set(), f"short enough by now: take them off {LONG_FILES.name}"
    assert {name: lines for name, lines in lengths.items() if lines > MOST_LINES} == {}


def test_functions_stay_small():
    assert_none(
        (name, node.lineno, f"{node.name}: {length} lines") for name in FILES for node, length in long_functions(name)
    )


def long_functions(name):
    """Functions of a file whose body, the docstring apart, is too long, with its lines."""
    limit = MOST_LINES_OF_A_KERNEL if "kernels" in name.split("/") else MOST_LINES_OF_A_FUNCTION
    for node in ast.walk(tree_of(name)):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            body = node.body[1:] if ast.get_docstring(node) and len(node.body) > 1 else node.body
            length = (node.end_lineno or node.lineno) - body[0].lineno + 1
            if length > limit:
                yield node, length


def test_no_file_is_named_after_nothing():
    vague = {"utils", "util", "helpers", "common", "misc"}
    assert [name for name, file in FILES.items() if file.stem in vague] == []


@pytest.mark.parametrize("package", ALLOWED)
def test_every_room_says_what_it_is_for(package):
    rooms = {str(Path(name).parent) for name in FILES if name.startswith(f"{package}/")}
    silent = [room for room in rooms if not ast.get_docstring(tree_of(f"{room}/__init__.py"))]
    assert silent == []
