"""numba's compiler with less work for kernels that are loops over numbers: the same machine code in less time.

When to use: as ``pipeline_class`` of kernels that are loops over numbers. When not: for a kernel with closures or
comprehensions, with expressions of several whole arrays, which would not become one loop, or with texts and errors.

numba's manual describes how to give a function a compiler of one's own ("Customizing the compiler"). What is left out
or replaced is named here; all else, what a later numba adds too, is done as in numba's own compiler (decisions 0089
and 0095). Nothing is replaced in a numba that is newer than those it was tried with: there a start is slower.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import numba
from numba.core.compiler import CompilerBase, DefaultPassBuilder
from numba.core.compiler_machinery import PassManager

LEFT_OUT = {"InlineClosureLikes", "GenericRewrites", "InlineOverloads", "NopythonRewrites", "AnnotateTypes"}
"""Steps that look for something in every function and find nothing in a loop over numbers, and the listing of the
source with its types, for ``inspect_types``."""
LAST_NUMBA = (0, 68)
"""The last numba of which the steps that are replaced are known: they are its own affair, and may change."""


class LoopCompiler(CompilerBase):  # type: ignore[misc]
    """numba's compiler for functions that are loops over numbers and elements of arrays."""

    def define_pipelines(self) -> list[PassManager]:
        """The steps of a compilation."""
        manager = DefaultPassBuilder.define_nopython_pipeline(self.state)
        kept = [entry for entry in manager.passes if entry[0].__name__ not in LEFT_OUT]
        replaced = self.replaced_steps() if numba.version_info.short <= LAST_NUMBA else {}
        manager.passes = [(replaced.get(step.__name__, step), reason) for step, reason in kept]
        manager.finalize()
        return [manager]

    def replaced_steps(self) -> dict[str, Any]:
        """Steps of numba by their names, and those that do the same with less work."""
        return replaced_steps()


class WholeStepCompiler(LoopCompiler):
    """The same, with each step of a kernel optimised as a whole, too.

    From the code of its steps as they come LLVM makes a search over cells that takes 1.6 times as long.
    """

    def replaced_steps(self) -> dict[str, Any]:
        """As of all loops, but for the steps."""
        from mbf_abstract.compiling.step_library import WholeStepLowering

        return super().replaced_steps() | {"NativeLowering": WholeStepLowering}


@cache
def replaced_steps() -> dict[str, Any]:
    """Steps of numba by their names, and those that do the same with less work."""
    from mbf_abstract.compiling.known_types import KnownTypeInference
    from mbf_abstract.compiling.step_library import KernelLowering

    return {"NopythonTypeInference": KnownTypeInference, "NativeLowering": KernelLowering}
