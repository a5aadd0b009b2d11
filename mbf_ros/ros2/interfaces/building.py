"""Compiles interface packages with the rosidl generators of the installed ROS 2.

Only what rclpy needs is made: messages for Python, and the type support of Fast DDS, in one extension module. That
takes less than half the time of the packages' usual build, and neither CMake nor ament, whose files in the wheels name
folders of the machine that made them.
"""

from __future__ import annotations

import contextlib
import os
import shutil
import subprocess
import sys
import sysconfig
import tempfile
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

from mbf_ros.ros2.interfaces.definitions import interface_files, used_packages

FAST_DDS, CHOSEN = "rosidl_typesupport_fastrtps_c", "rosidl_typesupport_c"
RUNTIME = ("rosidl_runtime_c", CHOSEN, FAST_DDS, "rosidl_typesupport_fastrtps_cpp", "fastcdr", "rcutils")
OF_A_PACKAGE = ("rosidl_generator_c", "rosidl_generator_py", CHOSEN, FAST_DDS)
"""Libraries of each package that others use."""
INTERMEDIATE = ("*.c", "*.cpp", "*.h", "*.hpp", "*.o", "*.idl", "detail")


class BuildError(ValueError):
    """A package could not be compiled; the text says what is missing, or what the compiler wrote."""


def build(package: str, into: Path, on_step: Callable[[str], None] = lambda text: None) -> Path:
    """Compile a package for this Python; returns its folder in ``into``, which replaces a former one there.

    Beside the modules, the folder keeps the interface files and, as ``*.json``, the description and the RIHS01 hash of
    each type.

    Raises
    ------
    BuildError
        The generators or a compiler are missing, or it refused a file.
    """
    with tempfile.TemporaryDirectory() as folder:
        made = Path(folder) / package
        on_step(f"generating {package}")
        sources = _generate(package, made)
        on_step(f"compiling {package}: {len(sources)} files")
        _compile(package, made, sources)
        shutil.rmtree(into / package, ignore_errors=True)
        shutil.copytree(made, into / package, ignore=shutil.ignore_patterns(*INTERMEDIATE))
    return into / package


def _generate(package: str, made: Path) -> list[Path]:
    """Write Python, C and C++ of all interfaces of a package; returns what is to be compiled."""
    try:
        from rosidl_adapter.cli import TranslateActionToIDL, TranslateMsgToIDL, TranslateSrvToIDL
        from rosidl_generator_c.cli import GenerateC
        from rosidl_generator_py.cli import GeneratePython
        from rosidl_typesupport_c.cli import GenerateCTypesupport
        from rosidl_typesupport_fastrtps_c.cli import GenerateFastRTPSCTypesupport
    except ImportError as error:
        raise BuildError(f"the generators of ROS 2 are not installed ({error}); see docs/ros2.md") from error

    os.environ.setdefault("AMENT_PREFIX_PATH", sys.prefix)  # of the wheels; else a setup file sets it
    translators = {"msg": TranslateMsgToIDL, "srv": TranslateSrvToIDL, "action": TranslateActionToIDL}
    generators: list[Any] = [
        GenerateC("c"),
        GenerateFastRTPSCTypesupport(FAST_DDS),
        GenerateCTypesupport(CHOSEN, typesupport_implementations=[FAST_DDS]),
        GeneratePython("py", typesupport_implementations=[CHOSEN]),
    ]
    shares = [str(_prefix() / "share" / used) for used in used_packages(package)]
    with open(os.devnull, "w") as nowhere, contextlib.redirect_stdout(nowhere):  # each file is announced
        idl = []
        for name, text in interface_files(package).items():
            file = made / name
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_text(text, "utf-8")
            kind = file.suffix[1:]
            idl += translators[kind](kind).translate(package, [f"{made}:{name}"], [], made)
        for generator in generators:
            generator.generate(package, idl, shares, made)
    (made / "__init__.py").write_text("", "utf-8")
    return sorted(file for file in made.rglob("*") if file.suffix in (".c", ".cpp"))


def _prefix() -> Path:
    """Folder in which ROS 2 is installed."""
    from ament_index_python import get_package_prefix

    return Path(get_package_prefix("rosidl_runtime_c"))


def _compile(package: str, made: Path, sources: list[Path]) -> None:
    """Make the extension module of a package out of its sources."""
    import numpy

    prefix = _prefix()
    headers = prefix / "include"
    folders = [made.parent, headers, *sorted(headers.iterdir()), sysconfig.get_paths()["include"]]
    flags = ["-O0", "-fPIC", "-w", *(f"-I{folder}" for folder in (*folders, numpy.get_include()))]

    def compile_one(source: Path) -> str:
        compiler = ["gcc", "-std=c11"] if source.suffix == ".c" else ["g++", "-std=c++17"]
        target = str(source.with_suffix(".o"))
        _run([*compiler, *flags, "-c", str(source), "-o", target])
        return target

    with ThreadPoolExecutor(os.cpu_count() or 1) as pool:
        objects = list(pool.map(compile_one, sources))
    names = [f"{used}__{kind}" for used in used_packages(package) for kind in OF_A_PACKAGE]
    libraries = [name for name in (*names, *RUNTIME) if (prefix / "lib" / f"lib{name}.so").exists()]
    module = made / f"{package}_s__{CHOSEN}{sysconfig.get_config_var('EXT_SUFFIX')}"
    search = [f"-L{prefix / 'lib'}", f"-Wl,-rpath,{prefix / 'lib'}"]
    _run(["g++", "-shared", "-o", str(module), *objects, *search, *(f"-l{name}" for name in libraries)])


def _run(command: list[str]) -> None:
    try:
        done = subprocess.run(command, capture_output=True, text=True)
    except FileNotFoundError as error:
        raise BuildError(f"{command[0]} is not installed") from error
    if done.returncode:
        raise BuildError(f"{command[0]} failed:\n{done.stderr[-2000:]}")
