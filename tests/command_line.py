"""The command line ``mbf`` in the process of a test."""

from typer.testing import CliRunner, Result

from mbf_abstract.cli import make_app

WIDTH = "300"  # columns, so that no line of the output is broken


def mbf(*arguments: object) -> Result:
    """Run ``mbf`` with these arguments; the result has ``exit_code`` and ``output``."""
    return CliRunner(env={"COLUMNS": WIDTH}).invoke(make_app(), [str(argument) for argument in arguments])
