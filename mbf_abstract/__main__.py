"""The program ``mbf``, also as ``python -m mbf_abstract``: Ctrl-C ends it with one line and exit code 130, always.

The command line takes a third of a second to import, in which a traceback would be all that an interrupt prints.
"""

from __future__ import annotations

from mbf_abstract.time.program_end import INTERRUPTED, interruptible


def main() -> None:
    """Run the command line; with Ctrl-C it ends as soon as what it has begun is in order."""
    with interruptible():
        try:
            from mbf_abstract.cli import main as run_command_line

            run_command_line()
        except SystemExit as end:
            if end.code != INTERRUPTED:
                raise
            raise KeyboardInterrupt from None


if __name__ == "__main__":
    main()
