"""``mbf --version``."""

from importlib.metadata import version

from typer.testing import CliRunner

from mbf_abstract.cli import make_app


def test_the_version_is_that_of_the_installed_distribution():
    result = CliRunner().invoke(make_app(), ["--version"])

    assert result.exit_code == 0
    assert result.stdout.strip() == f"mbf-flex {version('mbf-flex')}"
