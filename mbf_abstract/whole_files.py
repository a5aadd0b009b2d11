"""Atomic writes: to a temporary file beside the target, which replaces the target when it is complete."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


@contextmanager
def replacing(file: str | os.PathLike[str]) -> Iterator[Path]:
    """Yield a path of the same kind to write to; it takes the place of ``file`` when the block has ended well.

    An OSError about that path names ``file``, which is what the user knows.
    """
    file = Path(file)
    part = file.with_name(f".{file.stem}.{os.getpid()}.part{file.suffix}")
    try:
        yield part
        os.replace(part, file)
    except OSError as error:
        if error.errno is not None and error.filename in (None, part, str(part)):  # None: the disk is full
            error.filename = str(file)
            del error.filename2  # with None instead of it the text would end with "-> None"
        raise
    finally:
        part.unlink(missing_ok=True)


def write_whole(file: str | os.PathLike[str], content: str | bytes) -> None:
    """Write a file; text as UTF-8, with half of a surrogate pair, which is no Unicode, spelled out as its escape."""
    with replacing(file) as part:
        part.write_bytes(content.encode("utf-8", "backslashreplace") if isinstance(content, str) else content)
