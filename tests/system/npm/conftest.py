"""Unmodified clients of the npm registry in processes of node; they are installed once per machine into a cache."""

import fcntl
import hashlib
import json
import os
import re
import shutil
import subprocess
from contextlib import ExitStack
from pathlib import Path

import pytest

HERE = Path(__file__).parent
FILES = ("package.json", "package-lock.json")
OLDEST_NODE = 20  # of roslib 2.1
WITHIN = 300.0  # s; nothing waits that long unless it fails


def found_node():
    """Path of node itself, which may be behind a script of that name, and why there is none that will do, or ""."""
    ask = ["node", "-p", "process.execPath + ' ' + process.version"]
    tools = shutil.which("node") and shutil.which("npm")
    answer = subprocess.run(ask, capture_output=True, text=True).stdout.strip() if tools else ""
    path, _, version = answer.rpartition(" ")
    if not path or int(re.findall(r"\d+", version)[0]) < OLDEST_NODE:
        return path, f"clients of npm need npm and node {OLDEST_NODE} or newer, here is {version or 'none'}"
    return path, ""


@pytest.fixture(scope="session")
def node():
    """Path of node."""
    path, reason = found_node()
    if reason:
        pytest.skip(reason)
    return path


@pytest.fixture(scope="session")
def npm_folder(node):
    """Folder with the packages of ``package-lock.json``: in ``MBF_NPM_ENV``, or in the user's cache."""
    root = Path(os.environ.get("MBF_NPM_ENV") or Path.home() / ".cache" / "mbf-flex" / "npm")
    root.mkdir(parents=True, exist_ok=True)
    folder = root / hashlib.sha256(b"".join((HERE / name).read_bytes() for name in FILES)).hexdigest()[:16]
    with open(root / "lock", "w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)  # the processes of pytest-xdist come here together
        if not (folder / "complete").exists():
            shutil.rmtree(folder, ignore_errors=True)
            folder.mkdir()
            for name in FILES:
                shutil.copy(HERE / name, folder)
            install = ["npm", "ci", "--ignore-scripts", "--no-audit", "--no-fund", "--loglevel=error"]
            subprocess.run(install, check=True, cwd=folder, timeout=1800)
            (folder / "complete").touch()
    return folder


class Script:
    """A case of a script in node, as a process that writes lines of JSON."""

    def __init__(self, node, folder, script, *arguments):
        # From its standard input, because node looks for packages where a script lies, or else where it was started.
        command = [node, "--input-type=module", "-", *map(str, arguments)]
        pipes = dict.fromkeys(("stdin", "stdout", "stderr"), subprocess.PIPE)
        self.process = subprocess.Popen(command, cwd=folder, text=True, **pipes)
        self.process.stdin.write((HERE / script).read_text("utf-8"))
        self.process.stdin.close()
        self.process.stdin = None

    def line(self):
        """Wait for the next line."""
        return json.loads(self.process.stdout.readline())

    def value(self):
        """Wait for the end, and return the only line."""
        written, errors = self.process.communicate(timeout=WITHIN)
        assert self.process.returncode == 0, errors
        return json.loads(written)

    def kill(self):
        """As kill -9 does."""
        self.process.kill()
        self.process.communicate(timeout=WITHIN)


@pytest.fixture
def start(node, npm_folder):
    """Start scripts; all are killed at the end of the test."""
    with ExitStack() as closing:

        def run(script, *arguments):
            started = Script(node, npm_folder, script, *arguments)
            closing.callback(started.kill)
            return started

        yield run
