"""The program ``mbf``, also as ``python -m mbf_abstract``: Ctrl-C ends it with one line and exit code 130, always.

The command line takes a third of a second to import, in which a traceback would be all that an interrupt prints.
"""

from __future__ import annotations

import sys

INTERRUPTED = 130
"""Exit code of a program that SIGINT (2) has ended, as shells count: 128 + 2."""


def main() -> None:
    """Run the command line; with Ctrl-C it ends as soon as what it has begun is in order."""
    try:
        from mbf_abstract.cli import main as run_command_line

        run_command_line()
    except KeyboardInterrupt:
        _end_interrupted()
    except SystemExit as end:
        if end.code != INTERRUPTED:
            raise
        _end_interrupted()


def _end_interrupted() -> None:
    print("interrupted", file=sys.stderr, flush=True)  # noqa: T201 - typer may not be there yet
    raise SystemExit(INTERRUPTED) from None


if __name__ == "__main__":
    main()
