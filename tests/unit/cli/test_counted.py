"""Texts that count things."""

import pytest

from terrain.commands.counted import counted


@pytest.mark.parametrize(("number", "text"), [(0, "0 worlds"), (1, "1 world"), (2, "2 worlds")])
def test_one_thing_has_no_s(number, text):
    assert counted(number, "world") == text
