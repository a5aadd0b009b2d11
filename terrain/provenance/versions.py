"""The versions a run was made with: a scenario and seed give the same drive for equal versions and equal code only."""

from __future__ import annotations

import os
import platform
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

DECISIVE = (
    *("mbf-flex", "numpy", "scipy", "numba", "llvmlite", "pybullet", "trimesh", "networkx", "rtree", "h5py", "pillow"),
    *("pydantic", "pyyaml", "py_trees"),
)
"""Distributions whose code can change how a robot drives."""


def versions() -> dict[str, str]:
    """Versions of Python, of the C library and of every decisive distribution; the operating system and the CPU."""
    found = {"python": platform.python_version(), "libc": " ".join(platform.libc_ver()).strip()}
    for distribution in DECISIVE:
        try:
            found[distribution] = version(distribution)
        except PackageNotFoundError:
            found[distribution] = "not installed"
    return {**found, "system": f"{platform.system()} {platform.machine()}", "cpu": _cpu(), "cores": str(os.cpu_count())}


def _cpu() -> str:
    """Name of the CPU, from Linux or else from Python."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return platform.processor()
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.processor()
