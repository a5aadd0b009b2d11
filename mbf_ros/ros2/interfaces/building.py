"""Compiles interface packages with the rosidl generators of the installed ROS 2.

Only what rclpy needs is made: messages for Python, and the type support of Fast DDS. That takes less than half the time
of the packages' usual build, and neither CMake nor ament, whose files in the wheels name folders of the machine that
made them. Headers take most of a compiler's time, so all sources of a kind are compiled together.

Up to Jazzy, Fast DDS also asks for descriptions of types (introspection). Where a package has two type supports,
``rosidl_typesupport_c`` loads the library of the one that is asked for by its name. So each has a library of that name,
which holds nothing and leads to the library of the package; the extension module loads all of them with itself.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import sysconfig
import tempfile
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any, TextIO

from mbf_ros.ros2.interfaces.definitions import JAZZY, KILTED, interface_files, used_packages

FAST_DDS, CHOSEN = "rosidl_typesupport_fastrtps_c", "rosidl_typesupport_c"
INTROSPECTION = "rosidl_typesupport_introspection_c"
FAST_DDS_2 = "libfastrtps.so"
"""The library of Fast DDS in Humble to Jazzy; later ones have another name."""
RUNTIME = ("rosidl_runtime_c", CHOSEN, FAST_DDS, INTROSPECTION, "rosidl_typesupport_fastrtps_cpp", "fastcdr", "rcutils")
OF_A_PACKAGE = ("rosidl_generator_c", CHOSEN, FAST_DDS, INTROSPECTION)
FOR_PYTHON = "rosidl_generator_py"
"""Libraries of each package that others use; the one for Python only their extension modules."""
PYTHON = "for_python"
"""Name of the sources of the extension module."""
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
        _compile(package, made, _together(sources, Path(folder)))
        shutil.rmtree(into / package, ignore_errors=True)
        shutil.copytree(made, into / package, ignore=shutil.ignore_patterns(*INTERMEDIATE))
    return into / package


def _type_supports() -> list[str]:
    """Names of the type supports that the installed Fast DDS asks for."""
    return [FAST_DDS, INTROSPECTION] if _distribution() == JAZZY else [FAST_DDS]


def _distribution() -> str:
    """Which of the distributions whose packages are known is installed."""
    return JAZZY if (_prefix() / "lib" / FAST_DDS_2).exists() else KILTED


def _generate(package: str, made: Path) -> list[Path]:
    """Write Python, C and C++ of all interfaces of a package; returns what is to be compiled."""
    try:
        from rosidl_adapter.cli import TranslateActionToIDL, TranslateMsgToIDL, TranslateSrvToIDL
        from rosidl_generator_c.cli import GenerateC
        from rosidl_generator_py.cli import GeneratePython
        from rosidl_typesupport_c.cli import GenerateCTypesupport
        from rosidl_typesupport_fastrtps_c.cli import GenerateFastRTPSCTypesupport
        from rosidl_typesupport_introspection_c.cli import GenerateIntrospectionCTypesupport
    except ImportError as error:
        raise BuildError(f"the generators of ROS 2 are not installed ({error}); see docs/ros2.md") from error

    os.environ.setdefault("AMENT_PREFIX_PATH", sys.prefix)  # of the wheels; else a setup file sets it
    translators = {"msg": TranslateMsgToIDL, "srv": TranslateSrvToIDL, "action": TranslateActionToIDL}
    supports = _type_supports()
    described = made.parent / "introspection" / package  # apart, because some files are named as those of C
    generators: list[tuple[Any, Path]] = [
        (GenerateC("c"), made),
        (GenerateFastRTPSCTypesupport(FAST_DDS), made),
        (GenerateCTypesupport(CHOSEN, typesupport_implementations=supports), made),
        (GeneratePython("py", typesupport_implementations=[CHOSEN]), made),
    ]
    if INTROSPECTION in supports:
        generators.append((GenerateIntrospectionCTypesupport(INTROSPECTION), described))
    shares = [str(_prefix() / "share" / used) for used in used_packages(package, _distribution())]
    with _muted(), _parsed_once():
        idl = []
        for name, text in interface_files(package, _distribution()).items():
            file = made / name
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_text(text, "utf-8")
            kind = file.suffix[1:]
            idl += translators[kind](kind).translate(package, [f"{made}:{name}"], [], made)
        for generator, target in generators:
            generator.generate(package, idl, shares, target)
    (made / "__init__.py").write_text("", "utf-8")
    files = (file for folder in (made, described) for file in folder.rglob("*"))
    return sorted(file for file in files if file.suffix in (".c", ".cpp"))


_MUTE: list[TextIO] = []


@contextmanager
def _muted() -> Iterator[None]:
    """Print nothing: each file is announced.

    empy 3, which apt installs, puts a proxy before the first ``sys.stdout`` that it meets, and raises where that is
    gone later. So what it has left is put there again.
    """
    before = sys.stdout
    sys.stdout = _MUTE.pop() if _MUTE else open(os.devnull, "w")
    try:
        yield
    finally:
        _MUTE.append(sys.stdout)
        sys.stdout = before


@contextmanager
def _parsed_once() -> Iterator[None]:
    """Let the generators, each of which parses every file, share what the first one has parsed."""
    parser: Any = import_module("rosidl_parser.parser")
    parse = parser.get_ast_from_idl_string
    parser.get_ast_from_idl_string = cache(parse)
    try:
        yield
    finally:
        parser.get_ast_from_idl_string = parse


def _together(sources: list[Path], folder: Path) -> list[Path]:
    """Return sources each of which includes all of a kind, and those that cannot share a compilation.

    The kind is what follows the name of the interface, e.g. ``__functions.c``. Descriptions repeat those of the types
    that they use.
    """
    alone, kinds = [], dict[str, list[Path]]()
    for source in sources:
        _, separator, kind = source.name.partition("__")
        if kind == "description.c":
            alone.append(source)
        elif separator:
            kinds.setdefault(f"{source.relative_to(folder).parts[0]}_{kind}", []).append(source)
        else:
            kinds.setdefault(f"{PYTHON}{source.suffix}", []).append(source)
    for name, members in kinds.items():
        (folder / name).write_text("".join(f'#include "{member}"\n' for member in members), "utf-8")
    return [*alone, *(folder / name for name in kinds)]


def _prefix() -> Path:
    """Folder in which ROS 2 is installed."""
    from ament_index_python import get_package_prefix

    return Path(get_package_prefix("rosidl_runtime_c"))


def _compile(package: str, made: Path, sources: list[Path]) -> None:
    """Make the libraries and the extension module of a package out of its sources."""
    import numpy

    prefix = _prefix()
    headers = prefix / "include"
    folders = [made.parent, made.parent / "introspection", headers, *sorted(headers.iterdir())]
    folders += [Path(sysconfig.get_paths()["include"]), Path(numpy.get_include())]
    flags = ["-O0", "-fPIC", "-w", *(f"-I{folder}" for folder in folders)]

    def compile_one(source: Path) -> str:
        compiler = ["gcc", "-std=c11"] if source.suffix == ".c" else ["g++", "-std=c++17"]
        target = f"{source}.o"
        _run([*compiler, *flags, "-c", str(source), "-o", target])
        return target

    def link(name: str, objects: list[str], libraries: list[str]) -> None:
        search = [f"-L{made}", f"-L{prefix / 'lib'}", f"-Wl,-rpath,$ORIGIN:{prefix / 'lib'}"]
        names = ["-Wl,--no-as-needed", *(f"-l{library}" for library in libraries)]
        _run(["g++", "-shared", "-o", str(made / name), f"-Wl,-soname,{name}", *objects, *search, *names])

    def installed(libraries: list[str]) -> list[str]:
        return [name for name in libraries if (prefix / "lib" / f"lib{name}.so").exists()]

    with ThreadPoolExecutor(os.cpu_count() or 1) as pool:
        objects = dict(zip(sources, pool.map(compile_one, sources), strict=True))
    of_python = [made_of for source, made_of in objects.items() if source.stem == PYTHON]
    others = [made_of for source, made_of in objects.items() if source.stem != PYTHON]
    used = used_packages(package, _distribution())
    libraries = installed([*(f"{one}__{kind}" for one in used for kind in OF_A_PACKAGE), *RUNTIME])
    ours = [f"{package}__{CHOSEN}"]
    link(f"lib{ours[0]}.so", others, libraries)
    if INTROSPECTION in _type_supports():
        ours += [f"{package}__{support}" for support in _type_supports()]
        for name in ours[1:]:
            link(f"lib{name}.so", [], ours[:1])
    for_python = installed([f"{one}__{FOR_PYTHON}" for one in used])
    module = f"{package}_s__{CHOSEN}{sysconfig.get_config_var('EXT_SUFFIX')}"
    link(module, of_python, [*ours, *for_python, *libraries])


def _run(command: list[str]) -> None:
    try:
        done = subprocess.run(command, capture_output=True, text=True)
    except FileNotFoundError as error:
        raise BuildError(f"{command[0]} is not installed") from error
    if done.returncode:
        raise BuildError(f"{command[0]} failed:\n{done.stderr[-2000:]}")
