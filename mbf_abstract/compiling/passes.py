"""numba's compiler with less work for kernels that are loops over numbers: the same machine code in less time.

When to use: as ``pipeline_class`` of kernels that are loops over numbers. When not: for a kernel with closures or
comprehensions, with expressions of several whole arrays, which would not become one loop, or with texts and errors.

numba's manual describes how to give a function a compiler of one's own ("Customizing the compiler"). What is left out
or replaced is named here; all else, what a later numba adds too, is done as in numba's own compiler (decisions 0089
and 0095).
"""

from __future__ import annotations

from numba.core.compiler import CompilerBase, DefaultPassBuilder
from numba.core.compiler_machinery import PassManager

from mbf_abstract.compiling.known_types import KnownTypeInference
from mbf_abstract.compiling.step_library import KernelLowering

LEFT_OUT = {"InlineClosureLikes", "GenericRewrites", "InlineOverloads", "NopythonRewrites", "AnnotateTypes"}
"""Steps that look for something in every function and find nothing in a loop over numbers, and the listing of the
source with its types, for ``inspect_types``."""
REPLACED = {"NopythonTypeInference": KnownTypeInference, "NativeLowering": KernelLowering}
"""Steps that do the same with less work."""


class LoopCompiler(CompilerBase):  # type: ignore[misc]
    """numba's compiler for functions that are loops over numbers and elements of arrays."""

    def define_pipelines(self) -> list[PassManager]:
        """The steps of a compilation."""
        manager = DefaultPassBuilder.define_nopython_pipeline(self.state)
        kept = [entry for entry in manager.passes if entry[0].__name__ not in LEFT_OUT]
        manager.passes = [(REPLACED.get(step.__name__, step), reason) for step, reason in kept]
        manager.finalize()
        return [manager]
