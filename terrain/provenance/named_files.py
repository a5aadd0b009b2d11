"""Files that scenarios, configurations and maps name in their texts: found, hashed, and copied into a run's folder.

A text of a YAML or glTF file names a file if it is the absolute path of one, or its path from the folder that the text
stands in. Only texts with a suffix count, so that a plugin type is never taken for a file. A URDF names its meshes and
textures, in packages, too.
"""

from __future__ import annotations

import hashlib
import json
import re
import shutil
from collections.abc import Collection, Iterator, Mapping
from pathlib import Path
from typing import Any
from xml.sax.saxutils import quoteattr, unescape

import yaml

from mbf_abstract.config.yaml_source import read_yaml
from terrain.description.mesh_files import find_file

YAML_SUFFIXES = {".yaml", ".yml"}
GLTF_SUFFIX, URDF_SUFFIX = ".gltf", ".urdf"
FILE_OF_URDF = re.compile(r"""(filename\s*=\s*)("[^"]*"|'[^']*')""")
INPUTS = "inputs"
MAX_NAME = 200  # bytes; a longer text is no file's name
MAX_GLTF = 64_000_000  # bytes; a larger one holds its numbers itself


def named_file(text: object, folder: Path) -> Path | None:
    """Return the file that a value names, seen from ``folder``; None if it names none."""
    if not isinstance(text, str) or not Path(text).suffix or "\0" in text or len(text.encode()) > MAX_NAME:
        return None
    file = folder / text
    return file if file.is_file() else None


def named_files(value: Any, folder: Path) -> Iterator[Path]:
    """Files that the texts in a value name, whatever mappings and lists it consists of."""
    if isinstance(value, Mapping):
        value = list(value.values())
    if isinstance(value, list):
        for item in value:
            yield from named_files(item, folder)
    elif (file := named_file(value, folder)) is not None:
        yield file


def content_of(file: Path) -> Any:
    """Return the values of a file whose texts may name files; None for other files, and for those that are damaged."""
    if file.suffix.lower() in YAML_SUFFIXES:
        document = read_yaml(file, [])
        return None if document is None else document.data
    if file.suffix.lower() == URDF_SUFFIX:
        names = (_unquoted(match[2]) for match in FILE_OF_URDF.finditer(_text_of(file)))
        return [str(found.absolute()) for name in names if (found := find_file(name, file.parent)) is not None]
    if file.suffix.lower() != GLTF_SUFFIX or file.stat().st_size > MAX_GLTF:
        return None
    try:
        return json.loads(file.read_bytes())
    except (ValueError, RecursionError):
        return None


def _text_of(file: Path) -> str:
    return file.read_text("utf-8", "surrogateescape")


def _unquoted(attribute: str) -> str:
    """Value of an attribute of XML."""
    return unescape(attribute[1:-1], {"&quot;": '"', "&apos;": "'"})


def with_named_files(file: Path) -> list[Path]:
    """Return a file and all files that it names, and those name, each once."""
    found: dict[Path, Path] = {}
    open_files = [file]
    while open_files:
        here = open_files.pop()
        if here.resolve() not in found:
            found[here.resolve()] = here
            open_files += named_files(content_of(here), here.parent)
    return list(found.values())


def hash_with_named_files(file: Path, above: tuple[Path, ...] = ()) -> bytes:
    """SHA-256 of a file together with those that it names, but for those it is named by itself."""
    digest = hashlib.sha256(file.read_bytes())
    above = (*above, file.resolve())
    for named in named_files(content_of(file), file.parent):
        if named.resolve() not in above:
            digest.update(hash_with_named_files(named, above))
    return digest.digest()


def sha256_of(file: Path) -> str:
    """SHA-256 of the bytes of a file, 64 hexadecimal digits."""
    with file.open("rb") as opened:
        digest = hashlib.sha256()
        while block := opened.read(1 << 20):
            digest.update(block)
    return digest.hexdigest()


class InputCopies:
    """Copies what a run reads into the folder ``inputs`` of the run, each file once.

    Parameters
    ----------
    folder : Path
        Of the run.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder / INPUTS
        self._names: dict[Path, str] = {}

    def copy(self, file: Path) -> str:
        """Copy a file with all that it names; returns its path from the run's folder."""
        return f"{INPUTS}/{self._copied(file)}"

    def renamed(self, value: Any, folder: Path, kept: Collection[str] = ()) -> Any:
        """Return a configuration's value with the copies' paths instead of the files that it names.

        Parameters
        ----------
        folder : Path
            From which relative paths count.
        kept : collection of str
            Texts that stay, because the run itself writes those files.
        """
        return self._renamed(value, folder, f"{INPUTS}/", kept)

    def _renamed(self, value: Any, folder: Path, before: str, kept: Collection[str] = ()) -> Any:
        if isinstance(value, Mapping):
            return {key: self._renamed(item, folder, before, kept) for key, item in value.items()}
        if isinstance(value, list):
            return [self._renamed(item, folder, before, kept) for item in value]
        file = None if isinstance(value, str) and value in kept else named_file(value, folder)
        return value if file is None else f"{before}{self._copied(file)}"

    def _copied(self, file: Path) -> str:
        """Copy a file unless that was done; a copy stands beside the copies of what it names."""
        source = file.resolve()
        if source in self._names:
            return self._names[source]
        name = self._names[source] = self._free_name(file)
        content = content_of(file)
        renamed = self._renamed(content, file.parent, "")
        target = self._folder / name
        self._folder.mkdir(exist_ok=True)
        if file.suffix.lower() == URDF_SUFFIX:
            text = FILE_OF_URDF.sub(lambda match: self._of_urdf(match, file.parent), _text_of(file))
            target.write_bytes(text.encode("utf-8", "surrogateescape"))
        elif renamed != content:
            is_gltf = file.suffix.lower() == GLTF_SUFFIX
            target.write_text(json.dumps(renamed) if is_gltf else yaml.safe_dump(renamed, sort_keys=False), "utf-8")
        elif source != target.resolve():  # the same where a run's own scenario is run into its folder
            shutil.copyfile(source, target)
        return name

    def _of_urdf(self, match: re.Match[str], folder: Path) -> str:
        """Text of a URDF with the copy's name; a file that is not there keeps its name."""
        found = find_file(_unquoted(match[2]), folder)
        return match[0] if found is None else f"{match[1]}{quoteattr(self._copied(found))}"

    def _free_name(self, file: Path) -> str:
        taken = set(self._names.values())
        names = (file.name, *(f"{file.stem}_{number}{file.suffix}" for number in range(2, len(taken) + 3)))
        return next(name for name in names if name not in taken)
