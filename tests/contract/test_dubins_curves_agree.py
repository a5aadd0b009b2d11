"""Dubins curves of both maps: compiled for the search of cars on grids, plain for the last stretch on meshes."""

import math

import numpy as np

from mbf_costmap_nav.kernels.car.curves import curve_between
from mbf_mesh_nav.search.final_approach import dubins_curve

SPACING = 0.01  # m


def test_both_maps_find_curves_of_the_same_length():
    rng = np.random.default_rng(1)
    for _ in range(40):
        x, y, yaw = rng.uniform((-4.0, -4.0, -math.pi), (4.0, 4.0, math.pi)).tolist()
        radius = float(rng.uniform(0.3, 1.5))
        word = curve_between(np.array([x, y, yaw]), np.zeros(3), radius, False)
        points = dubins_curve((x, y, yaw), radius, SPACING)
        length, shortest = len(points) * SPACING, float(np.abs(word[:, 1]).sum()) * radius
        is_csc = word[1, 0] == 0.0  # of the words with three arcs the mesh knows none: its approaches are longer
        assert abs(length - shortest) <= SPACING if is_csc else length >= shortest - SPACING
