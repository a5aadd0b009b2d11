"""Computed layers kept in files, found again by mesh, layer type, parameters and the code that computes them.

mesh_navigation finds a stored layer by its name alone and so takes one made with another radius; here the file name is
a digest of what the values depend on, so that neither another radius nor another formula after an upgrade finds them.
What a layer class of yours imports from elsewhere is not part of it: empty the folder then. Files are written beside
and renamed, so a broken run leaves no half file; a file that cannot be read is computed anew. Nothing here raises: a
cache that cannot be used costs time, no map.
"""

from __future__ import annotations

import hashlib
import inspect
from functools import lru_cache
from pathlib import Path

import numpy as np

from mbf_abstract.config.bounded_files import ArrayFileError, read_arrays
from mbf_abstract.whole_files import replacing
from mbf_mesh_nav.map.layer import CostArray, LethalArray, MeshLayer

VALUE_BYTES = 5
"""Bytes of a vertex in a file: its cost as float32 and whether it is lethal."""


class LayerCache:
    """Stores the values of cacheable layers as ``.npz`` in a folder.

    Parameters
    ----------
    folder : path
        Made if it is missing.
    mesh_digest : str
        Of the mesh and of the errors of its heights, see ``map_builder.digest_of``.
    """

    def __init__(self, folder: str | Path, mesh_digest: str) -> None:
        self.folder = Path(folder)
        self.mesh_digest = mesh_digest

    def file_of(self, layer: MeshLayer) -> Path:
        """File that holds, or would hold, the values of a layer with its present parameters."""
        layer_class = type(layer)
        names = f"{layer_class.__module__}:{layer_class.__qualname__}"
        identity = f"{self.mesh_digest} {names} {_digest_of_code(layer_class)} "
        digest = hashlib.sha256((identity + layer.parameters.model_dump_json()).encode()).hexdigest()
        return self.folder / f"{layer_class.__name__}-{digest[:32]}.npz"

    def load(self, layer: MeshLayer) -> tuple[CostArray, LethalArray] | None:
        """Values (V,) float32 and (V,) bool of a layer, or None if there are none to be trusted."""
        count = layer.topology.vertex_count
        try:
            stored = read_arrays(self.file_of(layer), VALUE_BYTES * count, ("costs", "lethal"))
            costs, lethal = stored["costs"], stored["lethal"]
        except (OSError, TypeError, KeyError, ArrayFileError):  # whatever is wrong with it: compute it
            return None
        fits = costs.shape == lethal.shape == (count,) and costs.dtype == np.float32 and lethal.dtype == np.bool_
        return (costs, lethal) if fits else None

    def store(self, layer: MeshLayer) -> str:
        """Keep the present values of a layer; why that was not possible, or ""."""
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            with replacing(self.file_of(layer)) as unfinished:
                np.savez(unfinished, costs=layer.costs, lethal=layer.lethal)
        except (OSError, TypeError) as error:  # the latter for a class typed into an interpreter: it has no file
            return f"{type(error).__name__}: {getattr(error, 'strerror', None) or error}"
        return ""


@lru_cache
def _digest_of_code(layer_class: type[MeshLayer]) -> str:
    """Digest of the files a layer class is written in, of the kernels and of the normals they work on."""
    package = Path(__file__).parents[1]
    files = {*package.glob("kernels/**/*.py"), package / "mesh" / "topology.py"}
    files |= {Path(inspect.getfile(one)) for one in layer_class.__mro__ if issubclass(one, MeshLayer)}
    digest = hashlib.sha256()
    for file in sorted(files):
        digest.update(file.name.encode() + b"\0" + file.read_bytes() + b"\0")
    return digest.hexdigest()
