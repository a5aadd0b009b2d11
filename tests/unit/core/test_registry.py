import sys
from importlib.metadata import Distribution, EntryPoint

import pytest

from mbf_abstract.config import installed_plugins
from mbf_abstract.config.installed_plugins import GROUPS
from mbf_abstract.config.registry import PluginError, PluginRegistry
from mbf_abstract.plugins import AbstractPlanner, PlanResult, PluginKind

PLUGIN_SOURCE = """
from mbf_abstract.plugins import AbstractPlanner, PlanResult
class Planner(AbstractPlanner):
    version = 1
    def make_plan(self, request):
        return PlanResult(0)
class Unfinished(AbstractPlanner):
    pass
class Plain:
    speed = 1.0
class OddParameters(Planner):
    Parameters = Plain
class NavCorePlanner:
    pass
function = len
"""


class MeshPlanner(AbstractPlanner):
    def make_plan(self, request):
        return PlanResult(0)


class FreePlanner(MeshPlanner):
    pass


class Installed(Distribution):
    """A distribution of version 1.0."""

    def __init__(self, name):
        self._name = name

    def read_text(self, filename):
        return f"Metadata-Version: 2.1\nName: {self._name}\nVersion: 1.0\n" if filename == "METADATA" else None

    def locate_file(self, path):
        return path


@pytest.fixture(autouse=True)
def nothing_installed(monkeypatch):
    """Hide the entry points of the installed packages."""
    monkeypatch.setattr(installed_plugins, "installed_points", lambda group: [])


@pytest.fixture
def plugin_module(tmp_path, monkeypatch):
    """A module of plugins that lives for one test."""
    path = tmp_path / "plugin_module_under_test.py"
    path.write_text(PLUGIN_SOURCE)
    (tmp_path / "broken_plugin_module.py").write_text("raise RuntimeError('no driver')")
    monkeypatch.syspath_prepend(tmp_path)
    yield path
    sys.modules.pop("plugin_module_under_test", None)


@pytest.fixture
def installed(monkeypatch):
    """Pretend that distributions with these planner entry points are installed."""

    def install(*entries):
        points = []
        for name, value, distribution in entries:
            point = EntryPoint(name, value, "mbf.planners")
            vars(point).update(dist=Installed(distribution))
            points.append(point)
        monkeypatch.setattr(
            installed_plugins, "installed_points", lambda group: [point for point in points if point.group == group]
        )

    return install


def load(registry, type_name):
    return registry.load(PluginKind.PLANNER, type_name)


def reason(registry, type_name):
    with pytest.raises(PluginError) as error:
        load(registry, type_name)
    assert str(error.value) == f"planners: {error.value.type}: {error.value.reason}"
    assert error.value.type.endswith(type_name)
    return error.value.reason


def test_the_backends_own_plugin_comes_before_one_of_every_backend():
    registry = PluginRegistry("mesh")
    registry.register(PluginKind.PLANNER, "mesh.straight", MeshPlanner)
    registry.register(PluginKind.PLANNER, "straight", FreePlanner)
    registry.register(PluginKind.PLANNER, "costmap.grid", FreePlanner)
    assert load(registry, "straight") is MeshPlanner
    assert load(registry, "mesh.straight") is MeshPlanner
    assert registry.names(PluginKind.PLANNER) == ["straight"]
    registry.backend = "costmap"
    assert load(registry, "straight") is FreePlanner
    assert registry.names(PluginKind.PLANNER) == ["grid", "straight"]


def test_an_unknown_type_lists_what_is_known_and_what_is_closest(installed):
    installed()
    registry = PluginRegistry("mesh")
    assert reason(registry, "cvp") == "unknown type; no plugin of this kind is installed"
    registry.register(PluginKind.PLANNER, "mesh.cvp", MeshPlanner)
    registry.register(PluginKind.PLANNER, "mesh.astar", MeshPlanner)
    assert reason(registry, "cpv") == "unknown type; did you mean 'cvp'? known types: astar, cvp"


def test_an_entry_point_is_found_and_imported_when_asked_for(installed, plugin_module):
    installed(("mesh.fast", "plugin_module_under_test:Planner", "plugins-of-others"))
    assert load(PluginRegistry("mesh"), "fast").__name__ == "Planner"


def test_two_distributions_with_one_name_are_a_clash(installed, plugin_module):
    installed(
        ("mesh.fast", "plugin_module_under_test:Planner", "first"), ("mesh.fast", "plugin_module_under_test:X", "other")
    )
    assert reason(PluginRegistry("mesh"), "fast") == (
        "name clash between plugin_module_under_test:Planner (first 1.0) and plugin_module_under_test:X (other 1.0); "
        "use module:Class"
    )


@pytest.mark.parametrize(
    ("target", "expected"),
    [
        ("no_such_module:Planner", "import failed: ModuleNotFoundError: No module named 'no_such_module'"),
        ("broken_plugin_module:Planner", "import failed: RuntimeError: no driver"),
        ("plugin_module_under_test:Missing", "import failed: AttributeError"),
        ("plugin_module_under_test:Unfinished", "does not implement make_plan"),
        (
            "plugin_module_under_test:OddParameters",
            "its Parameters is <class 'plugin_module_under_test.Plain'>, expected",
        ),
        ("plugin_module_under_test:NavCorePlanner", "class NavCorePlanner is no AbstractPlanner"),
        ("plugin_module_under_test:function", "is not a class but a builtin_function_or_method"),
    ],
)
def test_what_cannot_be_used_is_refused_alike_as_module_type_and_as_entry_point(
    installed, plugin_module, target, expected
):
    installed(("mesh.bad", target, "plugins-of-others"))
    registry = PluginRegistry("mesh")
    assert reason(registry, target).startswith(expected)
    assert reason(registry, "bad").startswith(expected)


def test_of_a_module_in_the_folder_of_the_user_the_text_says_how_it_is_found(tmp_path, monkeypatch):
    (tmp_path / "my_own_module.py").write_text("", "utf-8")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", [entry for entry in sys.path if entry])
    assert reason(PluginRegistry("mesh"), "my_own_module:Planner").endswith(
        "my_own_module.py lies here, but not on the Python path: set PYTHONPATH=. or install it"
    )


def test_module_types_can_be_switched_off(plugin_module):
    assert load(PluginRegistry(), "plugin_module_under_test:Planner").version == 1
    registry = PluginRegistry(allow_module_types=False)
    assert "switched off" in reason(registry, "plugin_module_under_test:Planner")


def test_an_adapter_may_wrap_a_class_of_another_interface(plugin_module):
    def adapter(group, plugin_class):
        return MeshPlanner if (group, plugin_class.__name__) == ("planners", "NavCorePlanner") else None

    registry = PluginRegistry(adapters=[adapter])
    assert load(registry, "plugin_module_under_test:NavCorePlanner") is MeshPlanner
    registry.register(PluginKind.PLANNER, "odd", dict)
    assert reason(registry, "odd") == "class dict is no AbstractPlanner"


def test_a_group_without_an_interface_checks_the_base_it_is_given():
    registry = PluginRegistry("mesh")
    registry.register("mesh_layers", "mesh.height", dict)
    assert registry.load("mesh_layers", "height") is dict
    with pytest.raises(PluginError, match="class dict is no list"):
        registry.load("mesh_layers", "height", base=list)


def test_reload_takes_the_changed_source(installed, plugin_module):
    installed()
    registry, name = PluginRegistry(), "plugin_module_under_test:Planner"
    assert load(registry, name).version == 1
    plugin_module.write_text(PLUGIN_SOURCE.replace("version = 1", "version = 22"))
    assert registry.reload(PluginKind.PLANNER, name).version == 22
    plugin_module.write_text("this is no Python")
    with pytest.raises(PluginError, match="reload failed: SyntaxError"):
        registry.reload(PluginKind.PLANNER, name)


def test_reload_of_a_registered_class_gives_it_back():
    registry = PluginRegistry()
    registry.register(PluginKind.PLANNER, "own", MeshPlanner)
    assert registry.reload(PluginKind.PLANNER, "own") is MeshPlanner


def test_the_listing_holds_every_plugin_with_origin_and_error(installed, plugin_module):
    installed(
        ("mesh.fast", "plugin_module_under_test:Planner", "plugins-of-others"),
        ("mesh.broken", "broken_plugin_module:Planner", "plugins-of-others"),
        ("mesh.odd", "plugin_module_under_test:function", "plugins-of-others"),
    )
    registry = PluginRegistry()
    registry.register("servers", "own", dict)
    rows = [(entry.name, entry.group, entry.origin, entry.error) for entry in registry.entries()]
    assert rows == [
        ("mesh.broken", "planners", "plugins-of-others 1.0", "import failed: RuntimeError: no driver"),
        ("mesh.fast", "planners", "plugins-of-others 1.0", None),
        ("mesh.odd", "planners", "plugins-of-others 1.0", "is not a class but a builtin_function_or_method"),
        ("own", "servers", "registered", None),
    ]


def test_every_kind_has_a_group():
    assert {kind.value for kind in PluginKind} < set(GROUPS)
