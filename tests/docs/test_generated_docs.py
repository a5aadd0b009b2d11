"""What the documentation takes from the code is what the code says now."""

import dataclasses
import importlib
import math
import re
from pathlib import Path

import pytest
import yaml

from mbf_abstract.config.registry import PluginRegistry
from mbf_abstract.parameters import ParameterModel, parameter
from terrain.recording.metrics import Metrics

DOCS = Path(__file__).resolve().parents[2] / "docs"


@pytest.fixture(scope="module")
def generated():
    return importlib.import_module("generate_reference").generate()


def test_no_generated_file_is_out_of_date(generated):
    old = [file.name for file, text in generated.items() if not file.is_file() or file.read_text("utf-8") != text]
    assert not old, "run: python docs/generate_reference.py"


def test_every_parameter_has_a_sentence_and_every_plugin_a_summary(generated):
    page = "\n".join(text for file, text in generated.items() if file.name.startswith("configuration"))
    assert page.count("\n### `") > 50
    assert not re.findall(r"^\|.*\|\s*\|$", page, re.MULTILINE), "a parameter without a sentence"
    assert not re.findall(r"^### .*\n\n\n", page, re.MULTILINE), "a plugin without a text"


def test_every_plugin_stands_on_one_page_of_the_configuration(generated):
    pages = {file.stem: text for file, text in generated.items() if file.name.startswith("configuration")}
    ours = [entry.name for entry in PluginRegistry().entries() if entry.target.startswith("mbf_")]
    stands_on = {name: [page for page, text in pages.items() if f"### `{name}`" in text] for name in ours}
    assert {name: on for name, on in stands_on.items() if len(on) != 1 and "." in name} == {}
    assert stands_on["costmap.dwa"] == ["configuration_costmap"] and stands_on["tiles.hierarchical"] == [
        "configuration_mesh"
    ]
    assert max(len(text.splitlines()) for text in pages.values()) < 600


def test_the_fault_table_has_a_row_for_every_file(generated):
    rows = generated[DOCS / "faults_and_promises.md"]
    files = {file.name for file in (DOCS.parent / "tests" / "faults").glob("test_*.py")}
    assert {name for name in files if f"`{name}`" in rows} == files


def test_every_listing_names_a_file_and_shows_it(generated):
    listings = [match for text in generated.values() for match in re.findall(r"<!-- listing: (\S+) -->\n(.*)", text)]
    assert len(listings) >= 10
    assert [file for file, first in listings if first != "```python"] == []


def test_every_relative_link_leads_to_a_file():
    dead = []
    for page in DOCS.rglob("*.md"):
        for target in re.findall(r"\]\(([^)#:]+)(?:#[^)]*)?\)", page.read_text("utf-8")):
            if not (page.parent / target).exists():
                dead.append(f"{page.name}: {target}")
    assert not dead


def test_every_metric_of_a_recording_has_a_row_with_a_sentence(generated):
    rows = re.findall(r"^\| (`.*`) \| (.+) \|$", generated[DOCS / "verdict.md"], re.MULTILINE)
    named = {name.strip("`"): text for names, text in rows for name in names.split(", ")}
    fields = {field.name for field in dataclasses.fields(Metrics)} - {"scenario", "backend"}
    assert fields <= set(named)
    assert all(text.endswith(".") for name, text in named.items() if name in fields)


def test_every_key_of_a_scenario_has_a_sentence_and_every_type_of_a_block_a_section(generated):
    page = generated[DOCS / "scenario_reference.md"]
    assert not re.findall(r"^\|.*\|\s*\|$", page, re.MULTILINE), "a key without a sentence"
    for block, kind in (("world", "mesh"), ("features", "boulders"), ("sensors", "depth"), ("actors", "crowd")):
        assert re.search(rf"^### `{block}` of type .*`{kind}`", page, re.MULTILINE)
    assert page.count("| `max_tilt` |") == 1, "a model is shown once"


@pytest.mark.parametrize("value", [-math.inf, math.inf, 0.0, -0.25, 1e-6, 123456.0])
def test_a_default_reads_in_yaml_as_the_number_that_it_is(value):
    class Model(ParameterModel):
        limit: float = parameter(value, "A limit.", allow_inf=True)

    shown = importlib.import_module("parameter_tables")._default(Model.model_fields["limit"])
    assert float(yaml.safe_load(shown)) == value
