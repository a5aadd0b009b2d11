"""Computed layers kept in files, found again by mesh, layer type and parameters.

mesh_navigation finds a stored layer by its name alone and so takes one made with another radius; here the file name
is a digest of everything the values depend on. Files are written beside and renamed, so a broken run leaves no half
file; a file that cannot be read is computed anew. Nothing here raises: a cache that cannot be used costs time, no map.
"""

from __future__ import annotations

import hashlib
import os
from pathlib import Path

import numpy as np

from mbf_mesh_nav.layer import CostArray, LethalArray, MeshLayer


class LayerCache:
    """Stores the values of cacheable layers as ``.npz`` in a folder.

    Parameters
    ----------
    folder : path
        Made if it is missing.
    mesh_digest : str
        ``MeshTopology.digest()`` of the mesh.
    """

    def __init__(self, folder: str | Path, mesh_digest: str) -> None:
        self.folder = Path(folder)
        self.mesh_digest = mesh_digest

    def file_of(self, layer: MeshLayer) -> Path:
        """File that holds, or would hold, the values of a layer with its present parameters."""
        layer_class = type(layer)
        identity = f"{self.mesh_digest} {layer_class.__module__}:{layer_class.__qualname__} "
        digest = hashlib.sha256((identity + layer.parameters.model_dump_json()).encode()).hexdigest()
        return self.folder / f"{layer_class.__name__}-{digest[:32]}.npz"

    def load(self, layer: MeshLayer) -> tuple[CostArray, LethalArray] | None:
        """Values (V,) float32 and (V,) bool of a layer, or None if there are none to be trusted."""
        count = layer.topology.vertex_count
        try:
            with self.file_of(layer).open("rb") as file, np.load(file, allow_pickle=False) as stored:
                costs, lethal = stored["costs"], stored["lethal"]
        except Exception:  # a damaged zip file raises a dozen kinds of errors; all mean: compute it
            return None
        fits = costs.shape == lethal.shape == (count,) and costs.dtype == np.float32 and lethal.dtype == np.bool_
        return (costs, lethal) if fits else None

    def store(self, layer: MeshLayer) -> str:
        """Keep the present values of a layer; why that was not possible, or ""."""
        target = self.file_of(layer)
        unfinished = target.with_suffix(f".{os.getpid()}.npz")
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            try:
                np.savez(unfinished, costs=layer.costs, lethal=layer.lethal)
                unfinished.replace(target)
            finally:
                unfinished.unlink(missing_ok=True)
        except OSError as error:
            return f"{type(error).__name__}: {error.strerror or error}"
        return ""
