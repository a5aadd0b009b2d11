"""What a run was made of: ``provenance.yaml``, and the scenario as it was run, ``scenario.yaml``, in the run's folder.

``scenario.yaml`` holds every value of the scenario, those of ``--set``, ``--map``, ``--seed`` and ``--backend``
included, and names files of the folder only. So a run can be repeated from its folder alone.

No path of the machine is recorded, and no name of a user or a machine: files are recorded by their path in the folder.
"""

from __future__ import annotations

import os
import platform
from collections.abc import Collection, Mapping, Sequence
from enum import Enum
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any, Literal

import yaml
from pydantic import BaseModel

from mbf_abstract.config.findings import ConfigError, Finding
from mbf_abstract.config.validation import validate
from mbf_abstract.config.yaml_source import load_yaml
from mbf_abstract.parameters import ParameterModel, parameter
from mbf_abstract.server.navigation_server import AbstractNavigationServer
from mbf_abstract.whole_files import write_whole
from terrain.provenance.code import Code, code_of
from terrain.provenance.named_files import InputCopies, sha256_of, with_named_files
from terrain.scenarios.scenario import Scenario

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


FILE, SCENARIO = "provenance.yaml", "scenario.yaml"
NAVIGATION = Path("navigation.yaml")


class Provenance(ParameterModel):
    """What a run was made of and with."""

    command: str = parameter("", "The command line; empty for a run that a script has started.")
    executive: str = parameter(..., "Who decided on plans, drives and recoveries.")
    clock: Literal["simulated", "real"] = parameter(..., "Whether time was simulated; only then a run repeats.")
    live_page: bool = parameter(False, "Whether a page was served, whose commands are not recorded.")
    versions: dict[str, str] = parameter(..., "Versions of Python and of packages; system and CPU.")
    code: dict[str, Code] = parameter(..., "Packages of this project and of the plugins.")
    files: dict[str, str] = parameter(..., "SHA-256 of the scenario and of every file that it needs, by their paths.")


def write_scenario(
    folder: Path, scenario: Scenario, backends: Mapping[str, str], seed: int, inputs: InputCopies
) -> None:
    """Write a scenario as it is run, with the configurations that are in the folder; files that it names are copied.

    Parameters
    ----------
    backends : mapping of str to str
        Backend of each robot, by the names of ``robot_scenarios``; its configuration is in the folder of this name.
    """
    files = {name: {backend: Path(name) / NAVIGATION} for name, backend in backends.items()}
    robots = tuple(
        robot.model_copy(update={"backend": backends[robot.name], "navigation": files[robot.name]})
        for robot in scenario.robots
    )
    first, backend = next(iter(backends.items()))
    own = {"backend": backend, "seed": seed, "navigation": files[first], "robots": robots}
    as_run, written = scenario.model_copy(update=own), {file for named in files.values() for file in named.values()}
    write_whole(folder / SCENARIO, yaml.safe_dump(_plain(as_run, inputs, written), sort_keys=False))


def write_provenance(
    folder: Path,
    servers: Sequence[AbstractNavigationServer],
    command: str,
    executive: str,
    wall_clock: bool,
    live_page: bool,
) -> None:
    """Write ``provenance.yaml`` of a run whose scenario, configurations and maps are in its folder."""
    place = folder.resolve()  # a mesh of a URDF is named by its absolute path, whatever ``folder`` is
    named = {file.resolve() for file in with_named_files(folder / SCENARIO)}
    files = sorted(file for file in named if file.is_relative_to(place))
    provenance = Provenance(
        command=command,
        executive=executive,
        clock="real" if wall_clock else "simulated",
        live_page=live_page,
        versions=versions(),
        code=code_of(servers),
        files={file.relative_to(place).as_posix(): sha256_of(file) for file in files},
    )
    write_whole(folder / FILE, yaml.safe_dump(provenance.model_dump(), sort_keys=False))


def read_provenance(folder: Path) -> Provenance:
    """Read ``provenance.yaml`` of a run's folder.

    Raises
    ------
    ConfigError
        There is none, as in the folder of a run of an older version, or it is damaged; all findings.
    """
    file = folder / FILE
    if not file.is_file():
        expected = f"the folder of a run, with {FILE}"
        raise ConfigError(
            [Finding(str(folder), 1, "", expected, "a folder without it" if folder.is_dir() else "no such folder")]
        )
    document, findings = load_yaml(file), list[Finding]()
    provenance = validate(Provenance, document.data, document, (), findings)
    for name in () if provenance is None else provenance.files:
        if Path(name).is_absolute() or ".." in Path(name).parts:
            findings.append(document.finding(("files", name), "a path inside the folder", repr(name)))
    if provenance is None or findings:
        raise ConfigError(findings)
    return provenance


def changed_files(folder: Path, provenance: Provenance) -> list[str]:
    """Return the recorded files of a folder that are missing, or are not what they were."""
    return [
        name
        for name, sha256 in provenance.files.items()
        if not (folder / name).is_file() or sha256_of(folder / name) != sha256
    ]


def _plain(value: Any, inputs: InputCopies, written: Collection[Path]) -> Any:
    """Return a value as YAML writes it; a file becomes its copy, but for the configurations that the run writes."""
    if isinstance(value, BaseModel):
        return {name: _plain(getattr(value, name), inputs, written) for name in type(value).model_fields}
    if isinstance(value, Mapping):
        return {key: _plain(item, inputs, written) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item, inputs, written) for item in value]
    if isinstance(value, Path):
        return value.as_posix() if value in written else inputs.copy(value)
    if isinstance(value, Enum):
        return value.value
    return inputs.renamed(value, Path()) if isinstance(value, str) and Path(value).is_absolute() else value
