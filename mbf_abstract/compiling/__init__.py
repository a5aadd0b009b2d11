"""How numba kernels are compiled, cached and kept out of a plugin's patience."""
