"""The conformance suite on every backend: one test for each backend and situation."""

import pytest

from mbf_abstract.testing.conformance import SITUATIONS, check_map_backend

pytestmark = pytest.mark.usefixtures("one_core")


@pytest.mark.parametrize("situation", SITUATIONS)
def test_every_backend_keeps_the_contract(make_server, situation):
    check_map_backend(make_server, [situation])
