"""Keys of metrics in words."""

from dataclasses import fields

import pytest

from terrain.recording.metrics import Metrics
from terrain.sweeps.report import COLUMNS
from terrain.viewer.reports.metric_names import WORDS, in_words


@pytest.mark.parametrize(
    ("key", "words"),
    [
        ("max_tilt_deg", "max tilt [°]"),
        ("distance_to_goal_m", "distance to goal [m]"),
        ("planning_wall_p95_ms", "planning time, 95 % [ms]"),
        ("collisions_while_moving", "collisions while moving"),
        ("stops", "stops"),
        ("length / shortest", "length / shortest"),
        ("clearance [m]", "clearance [m]"),
    ],
)
def test_a_key_is_shown_in_words_with_its_unit_and_words_stay(key, words):
    assert in_words(key) == words


def test_no_metric_is_shown_as_a_key_and_no_two_as_one():
    keys = {*COLUMNS, *(field.name for field in fields(Metrics))}
    shown = [in_words(key) for key in keys]
    assert not [words for words in shown if "_" in words] and len(set(shown)) == len(keys)
    assert not [words for words in WORDS.values() if "_" in words]
