"""Options of ``mbf run`` that are of no use, as those for a page without one: one error each before anything drives."""

import pytest
from typer.testing import CliRunner

from mbf_abstract.cli import make_app


@pytest.mark.parametrize(
    ("options", "text"),
    [
        (["--view-read-only"], "Invalid value for --view-read-only: it goes with --view only"),
        (["--view-host", "0.0.0.0"], "Invalid value for --view-host: it goes with --view only"),
        (["--foxglove", "--view-port", "8081"], "Invalid value for --view-port: it goes with --view only"),
        (["--view-speed", "2"], "Invalid value for --view-speed: it goes with --view or --foxglove only"),
        (["--no-stay"], "it goes with --view or --foxglove only"),
        (["--seed", "-1"], "Invalid value for '--seed': Input should be greater than or equal to 0"),
        (["--foxglove", "--foxglove-origin", "app.example"], "such as http://localhost:8080, got 'app.example'"),
        (["--foxglove", "--foxglove-origin", "http://app.example/"], "got 'http://app.example/'"),
    ],
)
def test_an_option_without_use_is_refused(tmp_path, options, text):
    ended = CliRunner().invoke(make_app(), ["run", "indoor", "--out", str(tmp_path / "run"), *options])
    assert ended.exit_code == 2 and text in " ".join(ended.output.split())
    assert not (tmp_path / "run").exists()
