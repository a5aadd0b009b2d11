"""Findings of mesh checks, the report that lists them, and the error that refuses a mesh.

Use it to read the report of a loaded map (``mesh_map.report``). What the checks are and what repairs them stands in
``repair``.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

SHOWN_INDICES = 5


@dataclass(frozen=True, eq=False)
class Finding:
    """One kind of defect, or something a user of the map should know.

    Attributes
    ----------
    text : str
        A sentence with the count.
    indices : (n,) int64
        The caller's numbers of the vertices or faces concerned; empty if the finding is about none of them.
    harmless : bool
        Whether a mesh with it is taken although it was not repaired.
    """

    name: str
    text: str
    indices: NDArray[np.int64]
    repaired: bool = False
    harmless: bool = False

    @property
    def count(self) -> int:
        """How many vertices or faces are concerned."""
        return len(self.indices)

    def __str__(self) -> str:
        shown = ", ".join(str(index) for index in self.indices[:SHOWN_INDICES])
        more = ", ..." if self.count > SHOWN_INDICES else ""
        where = f" (indices {shown}{more})" if self.count else ""
        return f"{self.name}: {self.text}{where}{' - repaired' if self.repaired else ''}"


@dataclass
class MeshReport:
    """All findings of one mesh, in the order of the checks."""

    findings: list[Finding] = field(default_factory=list)

    def __getitem__(self, name: str) -> Finding:
        return next(finding for finding in self.findings if finding.name == name)

    def __contains__(self, name: str) -> bool:
        return any(finding.name == name for finding in self.findings)

    @property
    def refusals(self) -> list[Finding]:
        """Findings that are neither repaired nor harmless."""
        return [finding for finding in self.findings if not finding.repaired and not finding.harmless]


class MeshError(ValueError):
    """A mesh or its file cannot be used; names the file and every reason.

    Attributes
    ----------
    file : str
        The file, or "arrays".
    hint : str
        How the mesh could be used all the same; empty if it cannot.
    """

    def __init__(self, file: str, reasons: Sequence[str], hint: str = "") -> None:
        self.file = file
        self.reasons = list(reasons)
        self.hint = hint
        super().__init__(f"{file}: " + "; ".join(self.reasons) + (f". {hint}" if hint else ""))

    def __reduce__(self) -> tuple[type, tuple[object, ...]]:
        """Support pickling, for errors raised in worker processes."""
        return type(self), (self.file, self.reasons, self.hint)
