"""Identifiers, prose and documentation use the field's terms (docs/glossary.md); each test names all offenders."""

import ast
import io
import re
import tokenize
from functools import cache
from pathlib import Path

import pytest

REPOSITORY = Path(__file__).resolve().parents[2]
PACKAGES = ("mbf_abstract", "mbf_costmap_nav", "mbf_mesh_nav", "mbf_ros", "terrain")
FILES = [file for package in PACKAGES for file in sorted((REPOSITORY / package).rglob("*.py"))]
PAGES = [file for file in sorted((REPOSITORY / "docs").rglob("*.md")) if "results" not in file.as_posix()]  # dated
PAGES += [REPOSITORY / "README.md", REPOSITORY / "CONTRIBUTING.md"]
STANDARD = {  # banned word: the field's term
    "mishap": "incident",
    "doubt": "configuration warning",
    "doubtful": "uncertain, or what exactly is wrong",
    "tell": "report",
    "tells": "reports",
    "telling": "reporting",
    "told": "reported",
    "heed": "respect",
    "heeded": "respected",
    "mend": "repair",
    "mended": "repaired",
    "foretell": "predict",
    "foretold": "predicted",
    "taut": "string pulling",
    "hardness": "traversability rank",
    "sheet": "surface patch",
    "strip": "corridor",
    "rim": "boundary",
    "arms": "conditions (of an experiment)",
    "gates": "acceptance checks (of an experiment)",
    "stage": "environment",
    "tour": "waypoint sequence",
    "peer": "conformance",
    "hair": "a number with its unit",
}
PHRASES = (
    *("point contact", "way out", "search room", "turned map", "upright map", "cut file", "ego sensor", "peer fact"),
    *("a hair", "ready tree", "way around", "ways around", "ways through", "left of the way", "on its way on"),
)
ALLOWED_NAMES = {
    "str.strip": "strips blanks off a text",
    "LINE_STRIP": "a primitive of Foxglove's scenes",
    "LineStrips3D": "an archetype of rerun",
    "rim": "of a crater, a key of scenario files",
    "lever_arms": "of a force about an axis",
}
ALLOWED_PROSE = {
    ("terrain/scenarios/features.py", "rim"): "of a crater",
    ("terrain/worlds/generate.py", "rim"): "of a crater",
    ("docs/scenario_reference.md", "rim"): "of a crater, from the parameter models",
}


def in_words(name):
    return [word.lower() for word in re.findall(r"[A-Z]?[a-z]+|[A-Z]+(?![a-z])", name)]


def is_banned(word):
    return word in STANDARD or word.removesuffix("s") in STANDARD


def identifiers(file):
    """Names that a module defines or uses, with their lines; its own name at line 1."""
    yield file.stem, 1
    for node in ast.walk(ast.parse(file.read_text("utf-8"))):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
            yield node.name, node.lineno
        elif isinstance(node, ast.arg):
            yield node.arg, node.lineno
        elif isinstance(node, ast.Name):
            yield node.id, node.lineno
        elif isinstance(node, ast.Attribute):
            yield "str.strip" if node.attr == "strip" else node.attr, node.lineno


def prose(page):
    """Lines of a page outside of code blocks, without inline code and the targets of links."""
    in_code = False
    for number, line in enumerate(page.read_text("utf-8").splitlines(), 1):
        if line.lstrip().startswith("```"):
            in_code = not in_code
        elif not in_code:
            yield number, re.sub(r"`[^`]*`|\]\([^)]*\)", " ", line)


@cache
def prose_of(file):
    """Lines of docstrings, messages and comments of a module, without inline code."""
    source = file.read_text("utf-8")
    texts = [
        (node.lineno + offset, line)
        for node in ast.walk(ast.parse(source))
        if isinstance(node, ast.Constant) and isinstance(node.value, str)
        for offset, line in enumerate(node.value.splitlines())
    ]
    tokens = tokenize.generate_tokens(io.StringIO(source).readline)
    texts += [(token.start[0], token.string) for token in tokens if token.type == tokenize.COMMENT]
    return [(line, re.sub(r"`[^`]*`", " ", text).lower()) for line, text in texts]


def where(file, line):
    return f"{file.relative_to(REPOSITORY).as_posix()}:{line}"


def test_identifiers_use_the_fields_terms():
    offenders = {
        f"{where(file, line)} {name}"
        for file in FILES
        for name, line in identifiers(file)
        if name not in ALLOWED_NAMES and any(map(is_banned, in_words(name)))
    }
    assert sorted(offenders) == []


def test_identifiers_use_the_fields_phrases():
    offenders = {
        f"{where(file, line)} {name}"
        for file in FILES
        for name, line in identifiers(file)
        for phrase in PHRASES
        if re.search(rf"\b{phrase}s?\b", " ".join(in_words(name)))
    }
    assert sorted(offenders) == []


def test_docstrings_messages_and_comments_use_the_fields_words():
    offenders = {
        f"{where(file, line)} {word}"
        for file in FILES
        for line, text in prose_of(file)
        for word in re.findall(r"[a-z]+", text)
        if is_banned(word) and (file.relative_to(REPOSITORY).as_posix(), word) not in ALLOWED_PROSE
    }
    assert sorted(offenders) == []


def test_docstrings_messages_and_comments_use_the_fields_phrases():
    offenders = {
        f"{where(file, line)} {phrase}"
        for file in FILES
        for line, text in prose_of(file)
        for phrase in PHRASES
        if re.search(rf"\b{phrase}s?\b", text)
    }
    assert sorted(offenders) == []


def test_documentation_uses_the_fields_words():
    offenders = [
        f"{where(page, number)} {word}"
        for page in PAGES
        for number, line in prose(page)
        for word in re.findall(r"[a-z]+", line.lower())
        if is_banned(word) and (page.relative_to(REPOSITORY).as_posix(), word) not in ALLOWED_PROSE
    ]
    assert offenders == []


def test_documentation_uses_the_fields_phrases():
    offenders = [
        f"{where(page, number)} {phrase}"
        for page in PAGES
        for number, line in prose(page)
        for phrase in PHRASES
        if re.search(rf"\b{phrase}s?\b", line.lower())
    ]
    assert offenders == []


def test_files_are_named_in_the_fields_words():
    folders = ("docs", "tests", "examples", "benchmarks", *PACKAGES)
    names = [file for folder in folders for file in sorted((REPOSITORY / folder).rglob("*.py"))] + PAGES
    assert [where(file, 1) for file in names if any(map(is_banned, in_words(file.stem)))] == []


@pytest.mark.parametrize(
    ("name", "banned"), [("_tell_robot", True), ("ToldOnce", True), ("MAX_DOUBTS", True), ("intelligent_strips", True)]
)
def test_a_banned_word_is_found_in_every_style_of_name(name, banned):
    assert any(map(is_banned, in_words(name))) is banned
