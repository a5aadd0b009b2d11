"""Ctrl-C at any moment of a command: one line, exit code 130, no traceback; also of the processes that it starts."""

import signal
import subprocess
import sys
import threading

import numpy as np
import pytest

from mbf_abstract.commands.reporting import readable_errors
from mbf_abstract.session import NavigationSession
from mbf_abstract.time.program_end import end_of_the_program, interruptible
from mbf_mesh_nav.kernels.mesh.incidence import faces_of_vertices

AT_IMPORT = """
import signal, sys
signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell lets its background jobs ignore it

class Interrupting:
    def find_spec(self, name, path, target=None):
        if name == {module!r}:
            sys.meta_path.remove(self)
            signal.raise_signal(signal.SIGINT)

sys.meta_path.insert(0, Interrupting())
sys.argv = ["mbf", "plan", "nowhere.yaml", "--start", "1", "1", "--goal", "2", "2"]
from mbf_abstract.__main__ import main
main()
"""
IN_A_WORKER = """
import os, signal, sys
from pathlib import Path
from terrain.sweeps.worker_pool import run_in_workers

marker = Path(sys.argv[1])
if __name__ == "__main__":
    print(list(run_in_workers(abs, [-1], 1)))
elif not marker.exists():  # a worker, which imports the program first
    marker.touch()
    os.kill(os.getpid(), signal.SIGINT)
"""


@pytest.fixture
def default_handler():
    """What Ctrl-C does in a program of the foreground."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.mark.parametrize("module", ["typer", "terrain.commands.run", "mbf_abstract.commands.plan_picture"])
def test_an_interrupt_while_modules_are_imported_is_one_line(module):
    command = [sys.executable, "-c", AT_IMPORT.format(module=module)]
    done = subprocess.run(command, capture_output=True, text=True)
    assert (done.stdout, done.stderr) == ("", "interrupted\n")
    assert done.returncode in (130, -signal.SIGINT)  # 130 for a shell


def test_an_interrupt_while_a_kernel_runs_is_no_error_of_the_kernel(default_handler):
    """Numba turns it into a SystemError: what it calls to wrap its result raises, which it does not look at."""
    faces = np.arange(300_000, dtype=np.int32).reshape(-1, 3)
    faces_of_vertices(faces, faces.size)
    begun, main = threading.Event(), threading.get_ident()

    def interrupt():
        begun.wait()
        signal.pthread_kill(main, signal.SIGINT)

    thread = threading.Thread(target=interrupt)
    thread.start()
    with pytest.raises(KeyboardInterrupt), readable_errors():
        begun.set()
        while True:
            faces_of_vertices(faces, faces.size)
    thread.join()


def test_a_script_ends_with_130_also_where_a_library_makes_another_error_of_ctrl_c(capsys):
    with pytest.raises(SystemExit) as ended, interruptible():
        try:
            raise KeyboardInterrupt
        except KeyboardInterrupt as error:
            raise SystemError("returned a result with an exception set") from error
    assert ended.value.code == 130
    assert capsys.readouterr().err == "interrupted\n"


def test_an_error_that_is_its_own_cause_is_none_of_ctrl_c_and_hangs_nobody():
    error = ValueError("raised from itself")
    error.__cause__ = error
    assert end_of_the_program(error) is None


@pytest.mark.parametrize("error", [ValueError("wrong"), SystemExit(143)])
def test_what_is_no_interrupt_of_a_script_is_left_alone(error, capsys):
    with pytest.raises(type(error)) as raised, interruptible():
        raise error
    assert raised.value is error and not capsys.readouterr().err


def test_an_interrupt_of_a_closing_session_is_one_although_what_closes_next_raises():
    """Such as `release unlocked lock`, by what the interrupt has left halfway."""
    session, closed = NavigationSession(), []

    def interrupted():
        raise KeyboardInterrupt

    def left_halfway():
        raise RuntimeError("release unlocked lock")

    for call in (lambda: closed.append("the rest"), left_halfway, interrupted):
        session.on_close(call)
    with pytest.raises(KeyboardInterrupt), readable_errors():
        session.close()
    assert closed == ["the rest"]
    session.close()
    assert closed == ["the rest"]


def test_a_worker_that_is_interrupted_while_it_starts_ends_without_a_word(tmp_path):
    (tmp_path / "program.py").write_text(IN_A_WORKER)
    command = [sys.executable, str(tmp_path / "program.py"), str(tmp_path / "marker")]
    done = subprocess.run(command, capture_output=True, text=True)
    assert (done.stdout, done.stderr) == ("[(-1, 1)]\n", "")
    assert (tmp_path / "marker").exists()
