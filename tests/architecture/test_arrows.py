"""The rooms and arrows of the design, checked by parsing every module."""

import ast
from pathlib import Path

import pytest

REPOSITORY = Path(__file__).resolve().parents[2]
PACKAGES = ("mbf_abstract", "mbf_costmap_nav", "mbf_mesh_nav", "terrain")
ALLOWED = {
    "mbf_abstract": {"mbf_abstract"},
    "mbf_costmap_nav": {"mbf_abstract", "mbf_costmap_nav"},
    "mbf_mesh_nav": {"mbf_abstract", "mbf_mesh_nav"},
    "terrain": {"mbf_abstract", "terrain"},
}
CLOCKS = {"mbf_abstract/time/clock.py", "mbf_abstract/time/sim_clock.py", "mbf_abstract/time/sim_thread.py"}
SPAWNERS = ("mbf_abstract/execution/", "mbf_abstract/drive/velocity_gate.py", "mbf_abstract/testing/", "terrain/")
VIEWS = {"matplotlib", "viser", "rich", "typer", "PIL"}
PLUGIN_FOLDERS = ("planners", "controllers", "recoveries", "refiners")
MODULES = sorted(file for package in PACKAGES for file in (REPOSITORY / package).rglob("*.py"))
NAMES = [str(file.relative_to(REPOSITORY)) for file in MODULES]


def parse(file):
    return ast.parse(file.read_text(), str(file))


def imports(tree):
    """Every imported module with its line, wherever the import stands."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from ((alias.name, node.lineno) for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            yield node.module, node.lineno


def calls(tree):
    """Dotted names of everything that is called."""
    return {ast.unparse(node.func) for node in ast.walk(tree) if isinstance(node, ast.Call)}


@pytest.mark.parametrize("file", MODULES, ids=NAMES)
def test_a_package_imports_only_what_its_room_allows(file):
    package = file.relative_to(REPOSITORY).parts[0]
    wrong = [
        f"line {line}: {module}"
        for module, line in imports(parse(file))
        if module.split(".")[0] in PACKAGES and module.split(".")[0] not in ALLOWED[package]
    ]
    assert not wrong


@pytest.mark.parametrize("file", MODULES, ids=NAMES)
def test_time_threads_and_randomness_come_from_where_they_belong(file):
    name = str(file.relative_to(REPOSITORY))
    tree = parse(file)
    called = calls(tree)
    if name not in CLOCKS:
        assert "time" not in {module for module, _ in imports(tree)}, "only the clocks read the time"
        assert not called & {"threading.Thread", "Thread", "threading.Timer"}, "only a clock makes threads"
    if not name.startswith(SPAWNERS) and name not in CLOCKS:
        spawned = {call for call in called if call.endswith(".spawn")}
        assert not spawned, "threads start in execution/, the gate and the simulator only"
    seeded = {"np.random.default_rng", "np.random.Generator", "np.random.SeedSequence"}
    assert not {call for call in called if call.startswith(("np.random.", "random."))} - seeded


@pytest.mark.parametrize("file", MODULES, ids=NAMES)
def test_nothing_unsafe_is_called(file):
    tree = parse(file)
    assert "pickle" not in {module for module, _ in imports(tree)}
    assert not calls(tree) & {"yaml.load", "yaml.unsafe_load", "eval", "exec", "os.system"}


@pytest.mark.parametrize("file", MODULES, ids=NAMES)
def test_views_stay_out_of_algorithms(file):
    relative = file.relative_to(REPOSITORY)
    if not {"kernels", "layers", *PLUGIN_FOLDERS, "execution", "actions"} & set(relative.parts):
        return
    assert not {module.split(".")[0] for module, _ in imports(parse(file))} & VIEWS


@pytest.mark.parametrize("file", MODULES, ids=NAMES)
def test_plugins_know_no_server_no_action_and_no_other_plugin(file):
    relative = file.relative_to(REPOSITORY)
    if relative.parts[1] not in PLUGIN_FOLDERS or file.name == "__init__.py":
        return
    for module, line in imports(parse(file)):
        parts = module.split(".")
        assert "server" not in parts and "actions" not in parts, f"line {line}: {module}"
        assert not (parts[0] in PACKAGES and len(parts) > 2 and parts[1] in PLUGIN_FOLDERS), f"line {line}: {module}"


@pytest.mark.parametrize("file", MODULES, ids=NAMES)
def test_files_and_functions_stay_small(file):
    assert len(file.read_text().splitlines()) <= 400
    assert file.stem not in {"utils", "util", "helpers", "common", "misc"}
    kernel = "kernels" in file.parts
    for node in ast.walk(parse(file)):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            body = node.body[1:] if ast.get_docstring(node) and len(node.body) > 1 else node.body
            length = (node.end_lineno or node.lineno) - body[0].lineno + 1
            assert length <= (100 if kernel else 60), f"the body of {node.name} has {length} lines"


def test_no_import_cycle_inside_a_package():
    graph = {}
    known = {".".join(file.relative_to(REPOSITORY).with_suffix("").parts): file for file in MODULES}
    for module, file in known.items():
        tree = parse(file)
        at_import = [node for node in tree.body if isinstance(node, ast.Import | ast.ImportFrom)]
        targets = {m for m, _ in imports(ast.Module(at_import, []))}
        graph[module] = {target for target in targets if target in known}
    done, path = set(), []

    def visit(module):
        assert module not in path, " -> ".join([*path[path.index(module) :], module])
        if module in done:
            return
        path.append(module)
        for target in sorted(graph[module]):
            visit(target)
        path.pop()
        done.add(module)

    for module in sorted(graph):
        visit(module)


def test_the_plain_packages_import_without_simulator_and_plotting():
    """PyBullet is optional: nothing outside ``terrain`` may import it, nor any module that draws."""
    optional = {"pybullet", "pybullet_data", "matplotlib", "viser", "embreex", "mcap", "foxglove_schemas_protobuf"}
    for file, name in zip(MODULES, NAMES, strict=True):
        if not name.startswith("terrain/"):
            assert not {module.split(".")[0] for module, _ in imports(parse(file))} & optional, name
