"""Plain kernels make no array, return none and call plain ones: numba counts no references there (decision 0089)."""

import ast
from pathlib import Path

import pytest

REPOSITORY = Path(__file__).resolve().parents[2]
PLAIN, WITH_ARRAYS = (
    {"plain_kernel", "inner_kernel", "inlined_kernel"},
    {"kernel", "brief_kernel", "inner_array_kernel"},
)
MAKES_ARRAYS = {"empty", "zeros", "ones", "full", "arange", "array", "copy", "astype", "concatenate", "argsort", "sort"}


def kernels(text):
    """Every kernel of a file: how it is compiled, and its definition."""
    for node in ast.parse(text).body:
        if isinstance(node, ast.FunctionDef):
            for decorator in node.decorator_list:
                if (kind := ast.unparse(decorator)) in PLAIN | WITH_ARRAYS:
                    yield kind, node


def offences(definition, with_arrays):
    """What a plain kernel may not contain: its return type, what it calls."""
    if definition.returns is not None and "Array" in ast.unparse(definition.returns):
        yield f"returns {ast.unparse(definition.returns)}"
    for node in ast.walk(definition):
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute) and node.func.attr in MAKES_ARRAYS:
            yield f"{ast.unparse(node.func)}()"
        elif isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id in with_arrays:
            yield f"{node.func.id}(), which makes or returns arrays"


@pytest.mark.parametrize("package", ["mbf_mesh_nav", "mbf_costmap_nav"])
def test_plain_kernels_have_nothing_to_count(package):
    folder = REPOSITORY / package / "kernels"
    found = [(file, *entry) for file in sorted(folder.rglob("*.py")) for entry in kernels(file.read_text())]
    with_arrays = {definition.name for _, kind, definition in found if kind in WITH_ARRAYS}
    assert len(found) > 100
    listed = [
        f"{file.relative_to(folder)}: {definition.name}: {offence}"
        for file, kind, definition in found
        if kind in PLAIN
        for offence in offences(definition, with_arrays)
    ]
    assert not listed, "these have to be kernel or inner_array_kernel:\n" + "\n".join(listed)


def test_offenders_are_found():
    text = "@inner_kernel\ndef step(points) -> FloatArray:\n    made = np.empty(3)\n    return longer(points)"
    ((_, definition),) = kernels(text)
    assert list(offences(definition, {"longer"})) == [
        "returns FloatArray",
        "np.empty()",
        "longer(), which makes or returns arrays",
    ]
