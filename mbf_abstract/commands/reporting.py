"""How commands end with an error: one readable text on stderr and an exit code, never a traceback."""

from __future__ import annotations

import errno
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import typer

from mbf_abstract.time.program_end import end_of_the_program

FAILURE = 1
BAD_INPUT = 2
DISK_ERRORS = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO)
TRACEBACK_VARIABLE = "MBF_TRACEBACK"


@contextmanager
def readable_errors(written: Path | None = None) -> Iterator[None]:
    """Turn every exception into a text and exit code 2; set the environment variable MBF_TRACEBACK=1 to see it all.

    Parameters
    ----------
    written : Path, optional
        What the command writes; the error of a full disk names it, which the operating system does not.
    """
    try:
        yield
    except (typer.Exit, typer.Abort, typer.BadParameter):
        raise
    except Exception as error:
        ending = end_of_the_program(error)
        if ending is not None:
            raise ending from None
        if isinstance(error, OSError) and error.errno in DISK_ERRORS and error.filename is None and written is not None:
            error.filename = str(written)
        if os.environ.get(TRACEBACK_VARIABLE):
            raise
        from mbf_abstract.config.findings import ConfigError, text_of

        if isinstance(error, ConfigError):
            count = len(error.findings)
            typer.echo(f"{error}\n{count} mistake{'s' if count != 1 else ''} found", err=True)
        else:
            typer.echo(f"error: {text_of(error)}", err=True)
        raise typer.Exit(BAD_INPUT) from error
