"""Messages over a serial line: one message a line of text, each with a checksum, in pure Python (Linux, macOS).

A line is its text, ``*`` and the exclusive or of the text's bytes as two hexadecimal digits, as in NMEA 0183::

    O 1.20 0.40 0.05 0.300 0.000*70

Noise on the wire, and the half of a line that is there first, do not get through.
"""

import os
import select
import termios
import tty
from collections.abc import Iterator
from functools import reduce
from operator import xor

LONGEST = 20_000  # bytes without an end of line; a device that sends more of them speaks another language


def checksum(text: str) -> int:
    """Exclusive or of all bytes."""
    return reduce(xor, text.encode("ascii"), 0)


class SerialLine:
    """A device such as ``/dev/ttyUSB0``; raises OSError where it is not there, or something else."""

    def __init__(self, device: str, speed: int = termios.B115200) -> None:
        self.device = device
        self._file = os.open(device, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        if not os.isatty(self._file):
            raise OSError(f"{device} is no serial line")
        tty.setraw(self._file)  # no echo, no translation of line ends
        attributes = termios.tcgetattr(self._file)
        attributes[4] = attributes[5] = speed
        termios.tcsetattr(self._file, termios.TCSANOW, attributes)
        termios.tcflush(self._file, termios.TCIFLUSH)  # what was said before would be taken for new

    def write(self, text: str) -> None:
        """Send a message, without waiting; raises OSError where the line is cut or its buffer is full."""
        line = f"{text}*{checksum(text):02X}\n".encode("ascii")
        if os.write(self._file, line) != len(line):
            raise BlockingIOError(f"{self.device} takes no more")

    def messages(self) -> Iterator[list[str]]:
        """Wait for messages, and yield the words of each that is whole; raises OSError once the line is cut."""
        rest = b""
        while True:
            select.select([self._file], [], [])
            received = os.read(self._file, 4096)
            if not received:
                raise OSError(f"{self.device} has hung up")
            *lines, rest = (rest[-LONGEST:] + received).split(b"\n")
            for line in lines:
                text, _, sent = line.decode("ascii", "replace").rstrip("\r").rpartition("*")
                if text.isascii() and sent == f"{checksum(text):02X}":
                    yield text.split()
