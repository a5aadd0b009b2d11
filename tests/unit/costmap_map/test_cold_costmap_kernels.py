"""What a first start compiles for a flat map: the kernels, and nothing of numba's texts and reductions beside them."""

import os
import subprocess
import sys

FIRST_CALLS = """
import numpy as np
from numba.core import event

from mbf_costmap_nav.kernels.map.inflation import inflate
from mbf_costmap_nav.kernels.map.rasterisation import rasterise_polygon
from mbf_costmap_nav.kernels.search.open_list import RING, bucket_width, enlarged_if_full


class Names(event.Listener):
    def on_start(self, event):
        function = event.data["dispatcher"].py_func
        print(f"{function.__module__}.{function.__name__}")

    def on_end(self, event):
        pass


event.register("numba:compile", Names())
cells = np.zeros((4, 4), dtype=np.uint8)
inflate(cells, cells.copy(), (0, 0, 4, 4), np.zeros(5, dtype=np.uint8), 2, 255)
rasterise_polygon(np.array([[0.5, 0.5], [3.0, 0.5], [1.0, 3.0]]), (0, 0, 4, 4))
bucket_width(np.ones(256, dtype=np.float32), 2.0)
enlarged_if_full(np.zeros((RING, 4), dtype=np.int32), np.zeros(RING, dtype=np.int64), 8)
"""
LONG_TO_COMPILE = ("numba.cpython.unicode.", "numba.np.arraymath.npy_", "numba.np.arrayobj.numpy_take")


def test_no_kernel_of_a_first_plan_compiles_the_texts_of_numbas_errors_or_its_reductions(tmp_path):
    environment = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path), "PYTHONPATH": os.pathsep.join(sys.path)}
    command = [sys.executable, "-c", FIRST_CALLS]
    done = subprocess.run(command, env=environment, check=True, capture_output=True, text=True)
    compiled = done.stdout.split()
    assert "mbf_costmap_nav.kernels.map.inflation._spread_rows" in compiled
    assert "mbf_costmap_nav.kernels.search.open_list.enlarged_if_full" in compiled
    assert [name for name in compiled if name.startswith(LONG_TO_COMPILE)] == []
