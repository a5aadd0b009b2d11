"""Fault table, row 26: plugins that cannot be loaded."""

import pytest

from mbf_abstract.config.findings import ConfigError
from mbf_abstract.config.reading import load_config, validate_config
from mbf_abstract.config.registry import PluginRegistry
from mbf_abstract.events import EventKind
from mbf_abstract.geometry import Pose
from mbf_abstract.geometry.transform_buffer import TransformBuffer
from mbf_abstract.server.plugin_host import ServerError
from mbf_abstract.testing.loopback import LoopbackRobot
from mbf_abstract.testing.scripted import ScriptedPlanner
from mbf_abstract.testing.scripted_session import ScriptedSession

BAD_PLANNERS = """\
backend: none
planners:
  - {name: missing, type: 'no_such_module_anywhere:Planner'}
  - {name: wrong_base, type: 'pathlib:Path'}
  - {name: unknown, type: straight}
  - {name: clash, type: 'mbf_abstract.testing.scripted:ScriptedPlanner'}
  - {name: clash, type: 'mbf_abstract.testing.scripted:ScriptedPlanner'}
"""


class BrokenConstructor(ScriptedPlanner):
    def __init__(self, context):
        raise RuntimeError("no licence")


class ConstructorThatExits(ScriptedPlanner):
    def __init__(self, context):
        raise SystemExit("no licence")


def config(folder, text):
    path = folder / "robot.yaml"
    path.write_text(text)
    return validate_config(load_config(path), {}, PluginRegistry("none"))


def test_all_bad_plugins_are_listed_at_once(tmp_path):
    with pytest.raises(ConfigError) as error:
        config(tmp_path, BAD_PLANNERS)
    assert [finding.line for finding in error.value.findings] == [3, 4, 5, 7]
    text = str(error.value)
    for reason in ("no_such_module_anywhere", "class Path is no AbstractPlanner", "unknown type", "first in line 6"):
        assert reason in text


def test_optional_plugins_are_left_out_with_their_reason(tmp_path):
    text = BAD_PLANNERS.replace("'}", "', optional: true}").replace("straight}", "straight, optional: true}")
    text = text.rsplit("\n", 2)[0] + "\n"
    loaded = config(tmp_path, text)
    assert [spec.name for spec in loaded.plugins] == ["clash"]
    assert [skipped.name for skipped in loaded.skipped] == ["missing", "wrong_base", "unknown"]


@pytest.mark.parametrize(
    ("plugin", "text"),
    [(BrokenConstructor, "RuntimeError: no licence"), (ConstructorThatExits, "SystemExit: no licence")],
)
def test_a_raising_constructor_refuses_the_server_and_names_the_plugin(plugin, text):
    with pytest.raises(ServerError, match=rf"planner 'broken' \({plugin.__name__}\): {text}"):
        ScriptedSession({"broken": plugin})


def test_a_module_that_exits_on_import_is_a_finding(tmp_path, monkeypatch):
    (tmp_path / "a_script_without_a_main_guard.py").write_text("import sys\nsys.exit('usage: ...')\n")
    monkeypatch.syspath_prepend(tmp_path)
    text = "backend: none\nplanners:\n  - {name: p, type: 'a_script_without_a_main_guard:Planner'}\n"
    with pytest.raises(ConfigError, match=r"import failed: SystemExit: usage: \.\.\."):
        config(tmp_path, text)


def test_after_a_refused_start_a_good_one_works():
    with pytest.raises(ServerError):
        ScriptedSession({"good": ScriptedPlanner, "broken": BrokenConstructor})
    with ScriptedSession({"good": ScriptedPlanner}) as session:
        assert isinstance(session.robot, LoopbackRobot)
        assert isinstance(session.transforms, TransformBuffer)
        assert session.navigator.get_path(Pose.planar(1.0, 0.0)).success
        assert not session.recorded(EventKind.FAULT)
