"""The same scenario and seed is the same drive on meshes, to the last bit, on every CPU, locale, hash seed, folder.

A file for each kind of map, so that two workers share the work: each compiles and loads the kernels of its map only.
"""

import pytest

pytestmark = [pytest.mark.timeout(1800), pytest.mark.usefixtures("one_core")]

BACKEND = "mesh"
MORE = ["sweep"]
SOME = ["rubble_field"]


def test_drives_are_the_same_to_the_last_bit_elsewhere(here, elsewhere):
    assert elsewhere and not [drive for drive in elsewhere if here[drive] != elsewhere[drive]]


def test_the_scenarios_of_these_drives_succeed(here):
    """In CI they are all shipped ones of this map, whole: ``test_scenarios_succeed.py`` does not drive them again."""
    assert not {drive: failure for drive, (_, failure) in here.items() if failure}
