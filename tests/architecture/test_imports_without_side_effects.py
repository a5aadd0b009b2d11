"""An import of a package leaves the interpreter as it was; what other packages do on their own import is theirs."""

import subprocess
import sys
from pathlib import Path

REPOSITORY = Path(__file__).resolve().parents[2]
LOOK = """
import ast, gc, importlib, locale, logging, multiprocessing, os, pkgutil, random, signal, sys, threading, warnings
from pathlib import Path
import numpy as np

PACKAGES = ("mbf_abstract", "mbf_costmap_nav", "mbf_mesh_nav", "mbf_ros", "terrain")

def state():
    return {
        "garbage collector": (gc.isenabled(), gc.get_threshold(), gc.get_freeze_count(), len(gc.callbacks)),
        "flags": (sys.flags, sys.getrecursionlimit(), sys.getswitchinterval(), tuple(sys.path)),
        "hooks": (sys.excepthook, threading.excepthook, sys.unraisablehook, sys.gettrace(), sys.getprofile()),
        "streams": (sys.stdin, sys.stdout, sys.stderr),
        "warnings": list(warnings.filters),
        "environment": (dict(os.environ), os.getcwd(), locale.setlocale(locale.LC_ALL)),
        "signal handlers": [signal.getsignal(number) for number in signal.valid_signals()],
        "numpy errors": (np.geterr(), np.geterrcall(), np.get_printoptions()),
        "threads": threading.enumerate(),
        "processes": (multiprocessing.get_start_method(allow_none=True), multiprocessing.active_children()),
        "logging": (logging.root.level, list(logging.root.handlers)),
        "random numbers": (random.getstate(), str(np.random.get_state())),
    }

def import_all(names):
    for name in names:
        try:
            importlib.import_module(name)
        except ImportError:
            pass  # an extra that is not installed

def imported_by(package):
    for file in Path(package).rglob("*.py"):
        for node in ast.walk(ast.parse(file.read_text("utf-8"))):
            if isinstance(node, ast.Import):
                yield from (alias.name for alias in node.names)
            elif isinstance(node, ast.ImportFrom) and node.module:
                yield node.module

others = sorted({name for package in PACKAGES for name in imported_by(package)})
import_all(name for name in others if name.split(".")[0] not in PACKAGES)
assert not set(PACKAGES) & set(sys.modules)
before = state()
for package in PACKAGES:
    modules = pkgutil.walk_packages(importlib.import_module(package).__path__, package + ".")
    import_all(module.name for module in modules if ".templates." not in module.name)
after = state()
print(*(name for name in before if before[name] != after[name]), sep="\\n")
"""


def test_importing_every_module_changes_nothing_in_the_interpreter():
    command = [sys.executable, "-W", "default", "-c", LOOK]
    done = subprocess.run(command, cwd=REPOSITORY, check=True, capture_output=True, text=True)
    assert not done.stdout.split(), f"changed by an import: {done.stdout}"
