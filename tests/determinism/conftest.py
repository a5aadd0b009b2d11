"""Environments in which drives are repeated, each in a process of its own, and the digests of what happened there.

Other CPUs are emulated: OpenBLAS and numpy can be set to an older one, numba to compile for any. With
MBF_SAME_BYTES=all, as in ``.ci/run``, every drive is repeated as on Haswell. A few drives are repeated in the other
environments: an old CPU with kernels compiled anew for a generic one, and those whose libraries take the same steps as
in one of these two or on this machine; Skylake-X only where this CPU has AVX-512. Without it a few drives are repeated,
in fewer environments.
"""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

try:
    from numpy._core._multiarray_umath import __cpu_dispatch__, __cpu_features__
except ImportError:  # numpy before 2
    from numpy.core._multiarray_umath import __cpu_dispatch__, __cpu_features__

from terrain.scenarios.library import shipped_scenarios
from terrain.scenarios.scenario import load_scenario

DRIVES = Path(__file__).with_name("drives.py")
EVERYTHING = os.environ.get("MBF_SAME_BYTES") == "all"

VECTOR_UNITS = [name for name in __cpu_dispatch__ if __cpu_features__[name]]
AVX_512 = [name for name in VECTOR_UNITS if name.startswith(("AVX512", "X86_V4"))]
NO_AVX_512 = {"NPY_DISABLE_CPU_FEATURES": " ".join(AVX_512)}
OLDEST = {"OPENBLAS_CORETYPE": "Prescott", "NPY_DISABLE_CPU_FEATURES": " ".join(VECTOR_UNITS)}
ABROAD = {"LC_ALL": "de_DE.UTF-8", "TZ": "Asia/Kolkata"}

ENVIRONMENTS = {
    "an old CPU": OLDEST | {"PYTHONHASHSEED": "1", "OPENBLAS_NUM_THREADS": "1"},
    "Haswell": NO_AVX_512 | {"OPENBLAS_CORETYPE": "Haswell", "PYTHONHASHSEED": "2", "OPENBLAS_NUM_THREADS": "2"},
    "Zen, abroad": NO_AVX_512 | ABROAD | {"OPENBLAS_CORETYPE": "Zen", "PYTHONHASHSEED": "3"},
}
MANY_DRIVES = "Haswell"
# Its kernels end the process on a CPU without AVX-512, which cannot emulate it.
SKYLAKE_X = {"Skylake-X": {"OPENBLAS_CORETYPE": "SkylakeX", "PYTHONHASHSEED": "4"}}
IN_CI = (SKYLAKE_X if __cpu_features__["AVX512_SKX"] else {}) | {
    "kernels compiled anew for a generic CPU": OLDEST | ABROAD | {"NUMBA_CPU_NAME": "generic"},
}


def digests(names, environment, folder):
    """Digests and failures of the drives in a process of its own."""
    inherited = {name: value for name, value in os.environ.items() if not name.startswith(("OPENBLAS_", "NPY_"))}
    command = [sys.executable, str(DRIVES), *names]
    done = subprocess.run(command, env=inherited | environment, cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout.splitlines()[-1])
    assert found and list(found) == names
    return found


@pytest.fixture(scope="module")
def names(request):
    """Drives of this file: in CI every shipped scenario of its ``BACKEND`` and ``MORE``, elsewhere ``SOME``."""
    file = request.module
    if not EVERYTHING:
        return file.SOME
    return [name for name in sorted(shipped_scenarios()) if load_scenario(name).backend == file.BACKEND] + file.MORE


@pytest.fixture(scope="module")
def here(names, tmp_path_factory):
    """Digests and failures on this CPU as it is."""
    return digests(names, {}, tmp_path_factory.mktemp("here"))


@pytest.fixture(params=[*ENVIRONMENTS, *(IN_CI if EVERYTHING else ())])
def elsewhere(request, names, tmp_path):
    """Digests and failures in another environment."""
    environment = {**ENVIRONMENTS, **IN_CI}[request.param]
    if "NUMBA_CPU_NAME" in environment:
        environment = environment | {"NUMBA_CACHE_DIR": str(tmp_path / "kernels")}
    return digests(names if request.param == MANY_DRIVES else request.module.SOME, environment, tmp_path)
