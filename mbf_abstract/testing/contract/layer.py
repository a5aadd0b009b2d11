"""The contract of map layers, whatever the map.

What a layer must keep depends on its map: cells and boxes here, vertices and lethal flags there. So the base class of a
map's layers names the check of its map as ``contract_check = "module:function"``, and this runs it; the core itself
knows no layer. The parameters of the checks are documented in ``mbf_costmap_nav.testing.check_layer`` and
``mbf_mesh_nav.testing.check_layer``.
"""

from __future__ import annotations

import importlib
from typing import Any


def check_layer(layer_class: type, *world: Any, **options: Any) -> None:
    """Check a layer against the contract of its map's layers.

    Parameters
    ----------
    layer_class : type
        A layer of any map.
    *world, **options
        Handed to the check of that map: for a mesh layer the ``MeshMap`` it is computed on, for a costmap layer
        nothing.

    Raises
    ------
    ContractBroken
        With everything that is wrong.
    TypeError
        The class is no layer of a map that has a check.
    """
    named = getattr(layer_class, "contract_check", None)
    if not isinstance(named, str):
        name = getattr(layer_class, "__qualname__", repr(layer_class))
        raise TypeError(f"{name} is not a layer: expected a class with contract_check = 'module:function'")
    module, _, function = named.partition(":")
    getattr(importlib.import_module(module), function)(layer_class, *world, **options)
