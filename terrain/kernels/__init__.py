"""Kernels of the simulated world: arrays in, arrays out."""
