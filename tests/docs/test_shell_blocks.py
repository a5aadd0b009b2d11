"""The shell blocks of README and pages: every command is one that its program takes, and what it names exists.

Nothing is run: ``mbf`` parses each line with all its options and values, and stops there.
"""

import re
import shlex
from pathlib import Path

import pytest
import typer

from mbf_abstract.cli import make_app
from terrain.scenarios.library import LIBRARY

ROOT = Path(__file__).resolve().parents[2]
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").glob("*.md"))]
BLOCK = re.compile(r"^ *```sh\n(.*?)^ *```", re.DOTALL | re.MULTILINE)
INLINE = re.compile(r"`(mbf(?: [^`\n]+)?)`")
VARIABLE = re.compile(r"^\w+=")
PLACEHOLDER = re.compile(r"^[A-Z]+(\.\w+)?$|\.\.\.|/NAME\.yaml$")  # NAME, SCAN.las
OTHER_PROGRAMS = {".", "echo", "journalctl", "make", "pip", "podman", "pytest", "python", "python3", "ros2", "sudo"}


def commands_of(page):
    """The commands of a page's shell blocks as lists of words: without comments, variables and what joins them."""
    for block in BLOCK.findall(page.read_text("utf-8")):
        for line in block.replace("\\\n", " ").splitlines():
            for command in re.split(r" && | \| ", line):
                words = shlex.split(command, comments=True)
                while words and VARIABLE.match(words[0]):
                    words.pop(0)
                if words:
                    yield words


COMMANDS = [(page.name, words) for page in PAGES for words in commands_of(page)]


@pytest.fixture(scope="module")
def mbf():
    """The command line, whose commands do nothing once their arguments are read."""
    command = typer.main.get_command(make_app())

    def do_nothing(one):
        one.callback = None
        for inner in getattr(one, "commands", {}).values():
            do_nothing(inner)

    do_nothing(command)
    return command


@pytest.mark.parametrize("page", sorted({page for page, words in COMMANDS if words[0] == "mbf"}))
def test_every_command_of_a_page_is_read_by_the_command_line(page, mbf):
    wrong = []
    for words in [words for name, words in COMMANDS if name == page and words[0] == "mbf"]:
        try:
            mbf.main(words[1:], standalone_mode=False)
        except Exception as error:
            wrong.append(f"{shlex.join(words)}: {error}")
    assert not wrong


def test_every_block_names_its_language():
    """One without a name would not be looked at here, nor by the tests of YAML and Python."""
    for page in PAGES:
        fences = re.findall(r"^ *```(.*)$", page.read_text("utf-8"), re.MULTILINE)
        assert all(fences[::2]) and not any(fences[1::2]), page.name


def test_a_command_that_does_not_exist_or_has_a_wrong_value_is_not_read(mbf):
    for wrong in ("drive indoor", "run indoor --sped 3", "run indoor --seed three", "plan map.yaml --start 1 2"):
        with pytest.raises(Exception, match=r"[Nn]o such|a valid integer|[Mm]issing"):
            mbf.main(wrong.split(), standalone_mode=False)


@pytest.mark.parametrize(
    "page", [page for page in PAGES if INLINE.search(page.read_text("utf-8"))], ids=lambda p: p.stem
)
def test_every_command_within_a_sentence_exists_with_its_options(page, mbf):
    for text in INLINE.findall(page.read_text("utf-8")):
        command, words = mbf, text.split()[1:]
        while words and words[0] in getattr(command, "commands", {}):
            command = command.commands[words.pop(0)]
        known = {option for one in command.params for option in one.opts + one.secondary_opts}
        known |= {"--help", "--install-completion"}
        assert {word.partition("=")[0] for word in words if word.startswith("--")} <= known, text
        is_group = hasattr(command, "commands")
        assert not is_group or not words or words[0].startswith("-") or PLACEHOLDER.search(words[0]), text


def test_every_scenario_that_is_run_is_shipped():
    run = [words[2] for _, words in COMMANDS if words[:2] in (["mbf", "run"], ["mbf", "sweep"])]

    assert len(run) > 12
    assert [name for name in run if not ((LIBRARY / f"{name}.yaml").is_file() or (ROOT / name).is_file())] == []


def test_every_script_and_folder_that_is_given_to_python_exists():
    given = [words[1] for _, words in COMMANDS if words[0] == "python"]

    assert len(given) > 3
    assert [name for name in given if not (ROOT / name).is_file()] == []


def test_every_extra_that_is_installed_is_one_of_the_project():
    known = set(re.findall(r"^([a-z0-9-]+) = \[", (ROOT / "pyproject.toml").read_text("utf-8"), re.MULTILINE))
    asked = [word for _, words in COMMANDS if "pip" in words[0] or "pip" in words[1:3] for word in words]
    extras = {
        extra for word in asked for part in re.findall(r"^(?:\.|mbf-flex)\[(.*)\]$", word) for extra in part.split(",")
    }

    assert extras and extras <= known


def test_every_target_of_make_exists():
    targets = re.findall(r"^(\w+):", (ROOT / "Makefile").read_text("utf-8"), re.MULTILINE)
    asked = {words[1] for _, words in COMMANDS if words[0] == "make"}

    assert asked and asked <= set(targets)


def test_no_other_program_is_asked_for():
    assert {words[0] for _, words in COMMANDS} == OTHER_PROGRAMS | {"mbf"}


def test_every_option_of_a_benchmark_in_the_results_is_one_of_its_script():
    page = (ROOT / "docs" / "results.md").read_text("utf-8")
    called = re.findall(r"`(?:\w+=\S+ )?python (benchmarks/\w+\.py)([^`]*)`", page)

    assert len(called) > 20
    for script, arguments in called:
        source = (ROOT / script).read_text("utf-8")
        asked = set(re.findall(r"--[a-z][a-z-]*", arguments))
        assert not [option for option in asked if f'"{option}"' not in source], f"{script} {arguments}"
