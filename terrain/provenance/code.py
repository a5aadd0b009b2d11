"""The code a run was made with: a hash of each package that took part, and the commit it was checked out at.

The hash decides whether the code is the same; the commit helps a reader to find it. It says nothing about changes that
were not committed, and there is none for a package that is installed and in no repository.
"""

from __future__ import annotations

import hashlib
import subprocess
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

from mbf_abstract.compiling.sources import read_source_files
from mbf_abstract.config.configuration import Config
from mbf_abstract.config.registry import PluginRegistry
from mbf_abstract.parameters import ParameterModel, parameter
from mbf_abstract.plugins import Plugin, PluginKind
from mbf_abstract.server.navigation_server import AbstractNavigationServer

OWN_PACKAGES = ("mbf_abstract", "terrain")
TIME_FOR_GIT = 10.0  # s


class Code(ParameterModel):
    """One package."""

    sha256: str = parameter(..., "Hash of the names and contents of its files.")
    commit: str = parameter("", "Commit of the git repository that it belongs to; empty if it belongs to none.")


def code_of(servers: Sequence[AbstractNavigationServer]) -> dict[str, Code]:
    """Return the packages of a run by name: this project's, and those of the configurations' plugins and layers."""
    modules = list(OWN_PACKAGES)
    for server in servers:
        modules += [type(server).__module__, *modules_of_plugins(server.config, server.plugin_registry())]
    packages = sorted({module.partition(".")[0] for module in modules})
    places = {package: place for package in packages if (place := place_of(package)) is not None}
    return {package: Code(sha256=hash_of_code(place), commit=commit_of(place)) for package, place in places.items()}


def modules_of_plugins(config: Config, registry: PluginRegistry) -> Iterator[str]:
    """Modules of all plugins and layers of a configuration, also of those inside of other plugins."""
    for kind, type_name in _types_of(config, f"{registry.backend}_layers"):
        yield registry.module_of(kind, type_name)


def _types_of(config: Config, layers: str) -> Iterator[tuple[PluginKind | str, str]]:
    """Group and type of every plugin and layer, also of those inside of other plugins; the group of layers is given."""
    for spec in config.plugins:
        yield spec.kind, spec.type_name
        yield from _inner_types(spec.plugin_class, spec.parameters)
    for section in config.sections.values():
        for layer in section.layers:
            yield layers, layer.type_name


def _inner_types(plugin_class: type[Plugin], parameters: ParameterModel) -> Iterator[tuple[PluginKind | str, str]]:
    for inner in plugin_class.inner_plugins:
        yield inner.kind, getattr(parameters, inner.type_key)


def place_of(package: str) -> Path | None:
    """Folder of an imported package, file of an imported module; None for code that was typed in."""
    module = sys.modules.get(package)
    file = getattr(module, "__file__", None)
    folders = list(getattr(module, "__path__", ()))
    if folders:
        return Path(folders[0])
    return Path(file) if file and Path(file).is_file() else None


def hash_of_code(place: Path) -> str:
    """SHA-256 of a module's file, or of all files of a package but caches and hidden ones, with their names."""
    digest = hashlib.sha256()
    for file, content in [(place, place.read_bytes())] if place.is_file() else read_source_files(place):
        digest.update(f"{file.relative_to(place.parent).as_posix()}\n{len(content)}\n".encode() + content)
    return digest.hexdigest()


def commit_of(place: Path) -> str:
    """Commit of the git repository that has a file, or a package's ``__init__.py``, under version control; else ""."""
    tracked = place / "__init__.py" if place.is_dir() else place
    if not _git(tracked.parent, "ls-files", "--error-unmatch", tracked.name):
        return ""
    return _git(tracked.parent, "rev-parse", "HEAD")


def _git(folder: Path, *arguments: str) -> str:
    """What git prints, "" where it fails or is not installed."""
    command = ["git", "-C", str(folder), *arguments]
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=TIME_FOR_GIT, check=False)
    except (OSError, subprocess.TimeoutExpired):
        return ""
    return done.stdout.strip() if done.returncode == 0 else ""
