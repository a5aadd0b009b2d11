"""Every test asserts something in a place that surely runs: not only under an ``if``, nor where an error is caught."""

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

REPOSITORY = Path(__file__).resolve().parents[2]
FILES = [file for folder in ("tests", "mbf_abstract/testing") for file in sorted((REPOSITORY / folder).rglob("*.py"))]
ASSERTING = frozenset(("fail", "raises", "warns"))
"""Functions of pytest that make a test fail. Names that begin with ``assert`` or ``check`` are taken for such, too."""


def asserts(node: ast.AST, names: frozenset[str]) -> bool:
    """Whether an assertion, or a call of a function that makes one, stands anywhere in a node."""
    return any(isinstance(one, ast.Assert) for one in ast.walk(node)) or not names.isdisjoint(calls(node))


def calls(node: ast.AST) -> set[str]:
    """Names of the functions that are called in a node; also ``fail`` where one begins like an assertion."""
    functions = [one.func for one in ast.walk(node) if isinstance(one, ast.Call)]
    names = {getattr(one, "attr", getattr(one, "id", "")) for one in functions}
    return names | {"fail" for name in names if name.startswith(("assert", "check"))}


def asserting_functions(functions: list[ast.FunctionDef]) -> frozenset[str]:
    """Names of the functions that make an assertion, or call one of these."""
    called = [(one.name, calls(one)) for one in functions]
    names = ASSERTING | {one.name for one in functions if asserts(one, ASSERTING)}
    while found := {name for name, others in called if name not in names and not names.isdisjoint(others)}:
        names |= found
    return names


def sure_parts(statements: list[ast.stmt]) -> Iterator[ast.AST]:
    """What runs of a test that raises nothing; a loop counts as run."""
    for one in statements:
        if isinstance(one, ast.With):
            yield from one.items
            if not any("suppress" in ast.unparse(item) for item in one.items):
                yield from sure_parts(one.body)
        elif isinstance(one, ast.For | ast.While):
            yield from sure_parts(one.body)
        elif isinstance(one, ast.Try):
            yield from sure_parts(one.body + one.orelse + one.finalbody)
        elif isinstance(one, ast.If):
            yield one.test
        elif not isinstance(one, ast.FunctionDef | ast.ClassDef):
            yield one


def test_no_test_can_pass_without_an_assertion():
    trees = {file: ast.parse(file.read_text("utf-8")) for file in FILES}
    functions = {
        file: [one for one in ast.walk(tree) if isinstance(one, ast.FunctionDef)] for file, tree in trees.items()
    }
    names = asserting_functions([one for found in functions.values() for one in found])

    offenders = [
        f"{file.relative_to(REPOSITORY)}:{one.lineno}: {one.name}"
        for file, found in functions.items()
        for one in found
        if one.name.startswith("test_") and not any(asserts(part, names) for part in sure_parts(one.body))
    ]
    assert not offenders, "\n".join(offenders)


@pytest.mark.parametrize(
    ("body", "is_sure"),
    [
        ("assert x", True),
        ("for y in x:\n    assert y", True),
        ("with pytest.raises(OSError):\n    x()", True),
        ("if x:\n    assert x", False),
        ("try:\n    x()\nexcept OSError as error:\n    assert x", False),
        ("with suppress(OSError):\n    assert x", False),
        ("def inner():\n    assert x", False),
        ("x()", False),
    ],
)
def test_an_assertion_that_may_be_left_out_is_noticed(body, is_sure):
    parts = sure_parts(ast.parse(body).body)
    assert any(asserts(part, ASSERTING) for part in parts) == is_sure
