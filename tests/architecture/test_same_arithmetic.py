"""Nothing that a robot or an event depends on may be computed by code that differs from CPU to CPU (decision 13)."""

import ast
import re
from pathlib import Path

REPOSITORY = Path(__file__).resolve().parents[2]
PACKAGES = ("mbf_abstract", "mbf_costmap_nav", "mbf_mesh_nav", "mbf_ros", "terrain")
ONLY_LOOKS = ("terrain/viewer/", "terrain/experiments/table1/statistics.py", "mbf_abstract/testing/")
ARITHMETIC = "mbf_abstract/geometry/arithmetic.py"

BLAS = {
    "dot",
    "einsum",
    "inner",
    "matmul",
    "vdot",
    "tensordot",
    "outer",
    "linalg",
    "polyfit",
    "lstsq",
    "corrcoef",
    "cov",
}
VECTOR_UNITS = {
    *("exp", "exp2", "expm1", "log", "log2", "log10", "log1p", "power", "float_power", "cbrt"),
    *("tan", "arcsin", "arccos", "arctan", "arctan2", "sinh", "cosh", "tanh", "arcsinh", "arccosh", "arctanh"),
}
TRANSFORM = re.compile(r"T_[a-z]+_[a-z]+")  # of a frame, from another one
EMBREE, GAUSS = "embreex", {"gaussian_filter", "gaussian_filter1d"}


def offences(file):
    """Lines of a file that compute what other CPUs compute differently."""
    in_kernel = "kernels" in file.parts  # compiled by numba: elementary functions are the C library's there
    for node in ast.walk(ast.parse(file.read_text())):
        if isinstance(node, ast.BinOp | ast.AugAssign) and isinstance(node.op, ast.MatMult):
            operands = (node.left, node.right) if isinstance(node, ast.BinOp) else (node.target, node.value)
            if not any(TRANSFORM.match(ast.unparse(operand)) for operand in operands):  # they compose by products
                yield node.lineno, "@"
        elif isinstance(node, ast.Attribute) and node.attr in BLAS and ast.unparse(node.value) in {"np", "numpy"}:
            yield node.lineno, node.attr
        elif isinstance(node, ast.Attribute) and node.attr in VECTOR_UNITS and ast.unparse(node.value) == "np":
            if not in_kernel:
                yield node.lineno, f"np.{node.attr}"
        elif isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute):
            name = node.func.attr
            if name == "dot" or name in GAUSS:
                yield node.lineno, name
            elif name in {"argsort", "argpartition"}:
                if not any(
                    keyword.arg == "kind" and ast.unparse(keyword.value) == "'stable'" for keyword in node.keywords
                ):
                    yield node.lineno, f"{name} without kind='stable'"
        elif isinstance(node, ast.Import | ast.ImportFrom):
            names = {alias.name for alias in node.names} | {getattr(node, "module", "") or ""}
            if any(name.split(".")[0] == EMBREE for name in names) or names & GAUSS:
                yield node.lineno, f"import {sorted(names)}"


def test_code_that_runs_while_a_robot_drives_has_the_same_bytes_on_every_cpu():
    wrong = []
    for package in PACKAGES:
        for file in sorted((REPOSITORY / package).rglob("*.py")):
            name = file.relative_to(REPOSITORY).as_posix()
            if name != ARITHMETIC and not name.startswith(ONLY_LOOKS):
                wrong += [f"{name}:{line} {what}" for line, what in offences(file)]
    assert not wrong, "\n".join(wrong)
