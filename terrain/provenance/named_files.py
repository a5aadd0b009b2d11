"""Files that scenarios, configurations and maps name in their texts: found, hashed, and copied into a run's folder.

A text of a YAML file names a file if it is the absolute path of one, or its path from the folder that the text stands
in. Only texts with a suffix count, so that a plugin type is never taken for a file. Files that were made by somebody
else and are merely used, a glTF and a URDF, name no other files than their formats let them: buffers and images of a
glTF; meshes and textures of a URDF, in packages, too. What else they mention stays out of a folder that is passed on.
"""

from __future__ import annotations

import hashlib
import html
import json
import re
import shutil
from collections.abc import Collection, Iterator, Mapping
from pathlib import Path
from typing import Any
from xml.sax.saxutils import quoteattr

import yaml

from mbf_abstract.config.bounded_files import configured_file
from mbf_abstract.config.findings import ConfigError
from mbf_abstract.config.yaml_source import read_yaml
from terrain.description.mesh_files import FORMATS, MAX_BYTES, find_file
from terrain.description.xml_source import Element, read_xml

YAML_SUFFIXES = {".yaml", ".yml"}
GLTF_SUFFIX, URDF_SUFFIX = ".gltf", ".urdf"
IMAGE_FORMATS = (".png", ".jpg", ".jpeg", ".bmp", ".gif", ".tga", ".tif", ".tiff", ".webp")
FORMATS_OF_URDF = {"mesh": FORMATS, "texture": IMAGE_FORMATS}  # by the element that names a file
FORMATS_OF_GLTF = {
    "buffers": (".bin", ".glbin", ".glbuf"),
    "images": IMAGE_FORMATS,
}  # by the list of objects with a ``uri``
FILE_OF_URDF = re.compile(r"""(filename\s*=\s*)("[^"]*"|'[^']*')""")
INPUTS = "inputs"
FOLDER_KEY = "folder"
MAX_NAME = 200  # bytes; a longer text is no file's name
MAX_GLTF = 64_000_000  # bytes; a larger one holds its numbers itself


def named_file(text: object, folder: Path) -> Path | None:
    """Return the file that a value names, seen from ``folder``; None if it names none."""
    if not isinstance(text, str) or not Path(text).suffix or "\0" in text or len(text.encode()) > MAX_NAME:
        return None
    file = configured_file(folder, text)
    return file if file.is_file() else None


def named_files(value: Any, folder: Path) -> dict[str, Path]:
    """Texts in a value that name files, and those files, whatever mappings and lists it consists of."""
    found = ((text, named_file(text, folder)) for text in _texts(value))
    return {text: file for text, file in found if file is not None}


def with_whole_folders(value: Any, folder: Path) -> Any:
    """Return a configuration's value with absolute paths of the folders that its keys ``folder`` name.

    They are maps of tiles, which are too large to be copied into a run; relative paths count from ``folder``.
    """
    if isinstance(value, list):
        return [with_whole_folders(item, folder) for item in value]
    if not isinstance(value, Mapping):
        return value
    return {
        key: str(configured_file(folder, item).absolute())
        if key == FOLDER_KEY and isinstance(item, str) and configured_file(folder, item).is_dir()
        else with_whole_folders(item, folder)
        for key, item in value.items()
    }


def _texts(value: Any) -> Iterator[str]:
    if isinstance(value, Mapping):
        value = list(value.values())
    if isinstance(value, list):
        for item in value:
            yield from _texts(item)
    elif isinstance(value, str):
        yield value


def files_named_in(file: Path) -> dict[str, Path]:
    """Texts of a file that name files, and those files; none of other formats, and of files that are damaged."""
    suffix = file.suffix.lower()
    if suffix == URDF_SUFFIX:
        return _files_of_urdf(file)
    content = _content_of(file)
    return _files_of_gltf(content, file.parent) if suffix == GLTF_SUFFIX else named_files(content, file.parent)


def _content_of(file: Path) -> Any:
    """Values of a YAML or glTF file; None of other files, and of those that are damaged."""
    if file.suffix.lower() in YAML_SUFFIXES:
        document = read_yaml(file, [])
        return None if document is None else document.data
    if file.suffix.lower() != GLTF_SUFFIX or file.stat().st_size > MAX_GLTF:
        return None
    try:
        return json.loads(file.read_bytes())
    except (ValueError, RecursionError):
        return None


def _files_of_gltf(content: Any, folder: Path) -> dict[str, Path]:
    found: dict[str, Path] = {}
    for key, formats in FORMATS_OF_GLTF.items() if isinstance(content, Mapping) else ():
        entries = content.get(key)
        for entry in entries if isinstance(entries, list) else ():
            named = named_files([entry.get("uri")], folder) if isinstance(entry, Mapping) else {}
            found |= {text: file for text, file in named.items() if _may_be_copied(file, formats)}
    return found


def _files_of_urdf(file: Path) -> dict[str, Path]:
    try:
        root = read_xml(file)
    except ConfigError:
        return {}
    found: dict[str, Path] = {}
    for element in _elements(root):
        name = element.attributes.get("filename", "")
        place = find_file(name, file.parent) if element.tag in FORMATS_OF_URDF else None
        if place is not None and _may_be_copied(place, FORMATS_OF_URDF[element.tag]):
            found[name] = place.absolute()
    return found


def _elements(element: Element) -> Iterator[Element]:
    """An element and all below it."""
    yield element
    for child in element.children:
        yield from _elements(child)


def _may_be_copied(file: Path, formats: Collection[str]) -> bool:
    return file.suffix.lower() in formats and file.stat().st_size <= MAX_BYTES


def with_named_files(file: Path) -> list[Path]:
    """Return a file and all files that it names, and those name, each once."""
    found: dict[Path, Path] = {}
    open_files = [file]
    while open_files:
        here = open_files.pop()
        if here.resolve() not in found:
            found[here.resolve()] = here
            open_files += files_named_in(here).values()
    return list(found.values())


def hash_with_named_files(file: Path, above: tuple[Path, ...] = ()) -> bytes:
    """SHA-256 of a file together with those that it names, but for those it is named by itself."""
    digest = hashlib.sha256(file.read_bytes())
    above = (*above, file.resolve())
    for named in files_named_in(file).values():
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
        named = {text: file for text, file in named_files(value, folder).items() if text not in kept}
        return _renamed(value, {text: self.copy(file) for text, file in named.items()})

    def _copied(self, file: Path) -> str:
        """Copy a file unless that was done; a copy stands beside the copies of what it names."""
        source = file.resolve()
        if source in self._names:
            return self._names[source]
        name = self._names[source] = self._free_name(file)
        new_names = {text: self._copied(named) for text, named in files_named_in(file).items()}
        target, suffix = self._folder / name, file.suffix.lower()
        self._folder.mkdir(exist_ok=True)
        if all(text == new for text, new in new_names.items()):
            if source != target.resolve():  # the same where a run's own scenario is run into its folder
                shutil.copyfile(source, target)
        elif suffix == URDF_SUFFIX:
            text = FILE_OF_URDF.sub(
                lambda match: _of_urdf(match, new_names), file.read_text("utf-8", "surrogateescape")
            )
            target.write_bytes(text.encode("utf-8", "surrogateescape"))
        else:
            content = _renamed(_content_of(file), new_names)
            is_gltf = suffix == GLTF_SUFFIX
            target.write_text(json.dumps(content) if is_gltf else yaml.safe_dump(content, sort_keys=False), "utf-8")
        return name

    def _free_name(self, file: Path) -> str:
        taken = set(self._names.values())
        names = (file.name, *(f"{file.stem}_{number}{file.suffix}" for number in range(2, len(taken) + 3)))
        return next(name for name in names if name not in taken)


def _renamed(value: Any, new_names: Mapping[str, str]) -> Any:
    """A value with other texts in place of some."""
    if isinstance(value, Mapping):
        return {key: _renamed(item, new_names) for key, item in value.items()}
    if isinstance(value, list):
        return [_renamed(item, new_names) for item in value]
    return new_names.get(value, value) if isinstance(value, str) else value


def _of_urdf(match: re.Match[str], new_names: Mapping[str, str]) -> str:
    """An attribute of a URDF with the copy's name; one that names no copied file stays."""
    new = new_names.get(html.unescape(match[2][1:-1]))
    return match[0] if new is None else f"{match[1]}{quoteattr(new)}"
