"""``mbf doctor``: check that what the commands need is installed, and print how to install the rest."""

from __future__ import annotations

import importlib
import os
import platform
import re
import socket
import sys
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache
from importlib.metadata import PackageNotFoundError, requires, version
from pathlib import Path

import typer

from mbf_abstract.commands.reporting import FAILURE
from mbf_abstract.config.installed_plugins import DISTRIBUTION
from mbf_abstract.native_output import quiet_native_output

NEEDED = (*("numpy", "scipy", "numba", "trimesh", "networkx", "rtree", "yaml", "pydantic", "rich", "py_trees", "PIL"),)
MESH_FILES = ("h5py", "lxml", "collada")
POINT_CLOUDS = ("laspy", "lazrs", "pyproj")
SIMULATION = ("pybullet", "matplotlib", "viser", "mcap", "mcap_protobuf", "foxglove_schemas_protobuf")
DISTRIBUTIONS = {
    "yaml": "pyyaml",
    "PIL": "pillow",
    "collada": "pycollada",
    "mcap_protobuf": "mcap-protobuf-support",
    "rerun": "rerun-sdk",
}  # where the names differ
OLDEST_PYTHON = (3, 10)


@dataclass(frozen=True)
class Finding:
    """One check: ``cure`` is empty where it passed."""

    what: str
    state: str
    cure: str = ""
    optional: bool = False


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("doctor")(doctor)


def doctor() -> None:
    """Check the installation; exit code 1 if something needed is missing."""
    findings = list(examine())
    for finding in findings:
        mark = "ok" if not finding.cure else "--" if finding.optional else "!!"
        typer.echo(f"{mark}  {finding.what:26} {finding.state}")
        if finding.cure:
            typer.echo(f"    {'':26} -> {finding.cure}")
    if any(finding.cure and not finding.optional for finding in findings):
        raise typer.Exit(FAILURE)


def examine() -> Iterator[Finding]:
    """Make all checks, in order."""
    enough = sys.version_info >= OLDEST_PYTHON
    yield Finding(
        "python", f"{platform.python_version()}, {os.cpu_count()} cores", "" if enough else "use 3.10 or newer"
    )
    for name in NEEDED:
        yield _package(name, "pip install mbf-flex", optional=False)
    for name in SIMULATION:
        yield _package(name, "needed by mbf run and pictures: pip install 'mbf-flex[sim]'", optional=True)
    for name in MESH_FILES:
        yield _package(name, "only for meshes in .h5 and .dae files: pip install 'mbf-flex[mesh-files]'", optional=True)
    for name in POINT_CLOUDS:
        yield _package(name, "only for .las, .laz, --crs of mbf map build: pip install 'mbf-flex[maps]'", optional=True)
    yield _package("websockets", "only for mbf bridge serve: pip install 'mbf-flex[bridge]'", optional=True)
    yield _package("rosbags", "only for mbf bag: pip install 'mbf-flex[bags]'", optional=True)
    yield _package("gymnasium", "only for terrain.learning: pip install 'mbf-flex[gym]'", optional=True)
    yield _package("rerun", "only for mbf replay --rrd, Python >= 3.11: pip install 'mbf-flex[rerun]'", optional=True)
    yield _package("av", "only for mbf replay --mp4: pip install 'mbf-flex[video]'", optional=True)
    yield _check("plugins", _plugins, "mbf plugins lists which and why")
    yield _check("kernel cache", _kernel_cache, "set NUMBA_CACHE_DIR to a folder that can be written")
    yield _check("loopback port", _loopback_port, "a firewall or sandbox forbids sockets: no live view")


def _package(name: str, cure: str, optional: bool) -> Finding:
    try:
        with quiet_native_output():
            importlib.import_module(name)
    except Exception as error:
        return Finding(name, f"{type(error).__name__}: {error}", cure, optional)
    distribution = DISTRIBUTIONS.get(name, name.replace("_", "-"))
    try:
        found = version(distribution)
    except PackageNotFoundError:
        return Finding(name, "importable")
    oldest = oldest_versions().get(distribution, "0")
    if _numbers(found) < _numbers(oldest):
        return Finding(name, f"{found}, {oldest} is needed", f"pip install '{distribution}>={oldest}'", optional)
    return Finding(name, found)


@cache
def oldest_versions() -> dict[str, str]:
    """Least version of each distribution that this package's own metadata asks for."""
    asked = (re.match(r"([\w.-]+)>=([\d.]+)", text) for text in requires(DISTRIBUTION) or ())
    return {match[1]: match[2] for match in asked if match}


def _numbers(of: str) -> tuple[int, ...]:
    """Major, minor and patch of a version."""
    return tuple(int(number) for number in re.findall(r"\d+", of)[:3])


def _check(what: str, look: Callable[[], str], cure: str) -> Finding:
    try:
        return Finding(what, look())
    except Exception as error:
        return Finding(what, f"{type(error).__name__}: {error}", cure)


def _plugins() -> str:
    from mbf_abstract.config.registry import PluginRegistry

    entries = PluginRegistry().entries()
    broken = [entry.name for entry in entries if entry.error]
    if broken or not entries:
        raise RuntimeError(f"{len(broken)} of {len(entries)} cannot be imported: {', '.join(broken) or 'none found'}")
    return f"{len(entries)} installed, all can be imported"


def _kernel_cache() -> str:
    """Compiled kernels are kept beside the source or in NUMBA_CACHE_DIR; without a cache each start compiles anew."""
    folder = Path(os.environ.get("NUMBA_CACHE_DIR") or Path(__file__).resolve().parents[1])
    with tempfile.TemporaryFile(dir=folder):
        return f"{folder} can be written"


def _loopback_port() -> str:
    with socket.create_server(("127.0.0.1", 0)) as server:
        return f"127.0.0.1:{server.getsockname()[1]} can be opened"
