"""The scripts of ``examples``: their help, and what they say of a wrong call."""

import signal
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
EXAMPLES = ROOT / "examples"
SCRIPTS = ("go_there", "navigation_tree", "waypoints_state_machine")


def called(script, *words):
    """Run a script of the examples."""
    command = [sys.executable, str(EXAMPLES / f"{script}.py"), *words]
    return subprocess.run(command, capture_output=True, text=True, check=False)


@pytest.mark.parametrize("script", SCRIPTS)
def test_help_is_no_failure(script):
    done = called(script, "-h")
    assert done.returncode == 0 and not done.stderr
    assert f"python examples/{script}.py" in done.stdout


@pytest.mark.parametrize("script", SCRIPTS)
@pytest.mark.parametrize(
    ("words", "text"),
    [
        (("nowhere", "mesh"), "nowhere:1: expected a file, or one of bridge, "),
        (("indoor", "typo"), "indoor.yaml:5: navigation: expected one of mesh, costmap, got 'typo'"),
    ],
)
def test_an_unknown_scenario_or_backend_is_one_line(script, words, text):
    done = called(script, *words)
    assert done.returncode == 2
    assert text in done.stderr and done.stderr.count("\n") == 1, done.stderr


def test_a_backend_that_a_scenario_of_ones_own_lacks_is_named_with_its_file_and_line():
    file = EXAMPLES / "robots" / "a1_indoors.yaml"
    done = called("go_there", str(file), "mesh")
    assert done.stderr == f"{file}:5: navigation: expected one of costmap, got 'mesh'\n"


@pytest.mark.timeout(300)  # kernels are compiled on a machine that has none
@pytest.mark.parametrize("script", SCRIPTS)
def test_ctrl_c_ends_a_script_with_one_line(script):
    process = subprocess.Popen(
        [sys.executable, "-u", str(EXAMPLES / f"{script}.py"), "indoor", "costmap"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),  # which a shell lets its jobs ignore
    )
    assert process.stdout.readline(), process.communicate()
    process.send_signal(signal.SIGINT)
    _, errors = process.communicate()
    assert (process.returncode, errors) == (130, "interrupted\n")


@pytest.mark.parametrize("script", SCRIPTS)
def test_a_missing_argument_is_named(script):
    done = called(script, "indoor")
    assert done.returncode == 2 and "required: backend" in done.stderr


def test_the_driver_over_udp_prints_its_help():
    done = called("udp_driver", "-h")
    assert done.returncode == 0 and not done.stderr
    assert "python examples/udp_driver.py my_robot.yaml 10.0.0.5:7000 4.0 2.0" in done.stdout


@pytest.mark.parametrize(
    ("base", "x", "text"),
    [
        ("127.0.0.1", "1", "expected HOST:PORT, got '127.0.0.1'"),
        ("127.0.0.1:70000", "1", "expected HOST:PORT, got '127.0.0.1:70000'"),
        ("127.0.0.1:seven", "1", "expected HOST:PORT, got '127.0.0.1:seven'"),
        ("127.0.0.1:7000", "one", "argument x: invalid float value: 'one'"),
    ],
)
def test_what_is_no_address_or_no_number_is_named_by_the_driver_over_udp(base, x, text):
    done = called("udp_driver", "robot.yaml", base, x, "2")
    assert done.returncode == 2 and done.stderr.splitlines()[-1].endswith(text), done.stderr


def test_the_driver_over_udp_finds_a_wrong_configuration_before_it_waits_for_the_base(tmp_path):
    (tmp_path / "robot.yaml").write_text("backend: hovercraft\n")
    done = called("udp_driver", str(tmp_path / "robot.yaml"), "127.0.0.1:9", "1", "2")  # nobody answers there
    assert done.returncode == 2 and "robot.yaml:1: backend: expected a known backend" in done.stderr
    assert not done.stdout


@pytest.mark.parametrize("script", ["environment_speed", "ros_maps", "ros2_robot"])
def test_benchmarks_without_options_print_their_help(script):
    command = [sys.executable, str(ROOT / "benchmarks" / f"{script}.py"), "-h"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0 and f"python benchmarks/{script}.py" in done.stdout, done.stderr
