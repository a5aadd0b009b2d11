"""The conformance suite on every backend: one test for each backend and situation."""

import pytest

from mbf_abstract.testing.conformance import SITUATIONS, check_map_backend

KNOWN = {
    ("mesh", "a_path_is_as_bad_as_its_worst_pose"): "of a path without poses it looks at pose 0",
}
"""Deviations that are to be mended, and are expected until then."""


@pytest.mark.parametrize("situation", SITUATIONS)
def test_every_backend_keeps_the_contract(make_server, situation, request):
    backend = make_server.__name__.removesuffix("_server")
    if (backend, situation) in KNOWN:
        request.applymarker(pytest.mark.xfail(reason=KNOWN[backend, situation], strict=True))
    check_map_backend(make_server, [situation])
