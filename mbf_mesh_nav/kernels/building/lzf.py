"""Decompression of LZF blocks (Marc Lehmann's LibLZF), which PCD files use."""

from __future__ import annotations

from mbf_mesh_nav.arrays import FlagArray
from mbf_mesh_nav.kernels.compiled import plain_kernel


@plain_kernel
def lzf_decompress(block: FlagArray, content: FlagArray) -> int:
    """Decompress ``block`` (n,) uint8 into ``content`` (m,) uint8; return the bytes written, -1 for a damaged block.

    A control byte below 32 is followed by that many literal bytes and one more. Above, its upper three bits are a
    length (7: the next byte is added to it), its lower five and the next byte the distance to copy from.
    """
    read, written = 0, 0
    size, room = block.shape[0], content.shape[0]
    while read < size:
        control = int(block[read])
        read += 1
        if control < 32:
            length = control + 1
            if read + length > size or written + length > room:
                return -1
            for step in range(length):
                content[written + step] = block[read + step]
            read += length
        else:
            length = control >> 5
            if length == 7:
                if read >= size:
                    return -1
                length += int(block[read])
                read += 1
            length += 2
            if read >= size:
                return -1
            source = written - ((control & 31) << 8) - int(block[read]) - 1
            read += 1
            if source < 0 or written + length > room:
                return -1
            for step in range(length):  # one by one: the copy may overlap what it writes
                content[written + step] = content[source + step]
        written += length
    return written
