"""The result files of the experiment are JSON for every reader."""

import json
import math
from pathlib import Path

import pytest

from terrain.experiments.table1.report import write_result

RESULTS = sorted((Path(__file__).resolve().parents[3] / "docs" / "results").glob("table1_*.json"))


def read_strictly(file):
    def refuse(constant):
        raise ValueError(f"{constant} is no JSON")

    return json.loads(file.read_text("utf-8"), parse_constant=refuse)


def test_what_is_undefined_is_null_and_what_is_infinite_a_text(tmp_path):
    result = {"ratios": {"recoveries": (math.nan, -math.inf, 2.5)}, "lethal_value": math.inf, "calls": [3, True, None]}

    write_result(tmp_path / "table1.json", result)

    assert read_strictly(tmp_path / "table1.json") == {
        "ratios": {"recoveries": [None, "-inf", 2.5]},
        "lethal_value": "inf",
        "calls": [3, True, None],
    }


@pytest.mark.parametrize("file", RESULTS, ids=lambda file: file.stem)
def test_the_kept_results_can_be_read_strictly(file):
    assert read_strictly(file)
