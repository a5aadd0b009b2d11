"""Arrays with one value in them, in kernels: ``np.zeros`` and ``np.full`` compile three functions per type of array."""

from __future__ import annotations

from typing import Any

from numpy.typing import NDArray

from mbf_mesh_nav.kernels.compiled import inner_kernel


@inner_kernel
def fill(array: NDArray[Any], value: Any) -> None:
    """Write a value, a ``Count`` whatever the array holds, to all places of an array (n,)."""
    for place in range(len(array)):
        array[place] = value
