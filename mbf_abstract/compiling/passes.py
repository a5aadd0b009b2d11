"""numba's compiler without the steps that find nothing in kernels: less time, the same machine code.

When to use: as ``pipeline_class`` of kernels that are loops over numbers. When not: for a kernel with closures or
comprehensions, with expressions of several whole arrays, which would not become one loop, or with texts and errors.

numba's manual describes how to give a function a compiler of one's own ("Customizing the compiler"). What is left out
is named here; all else, what a later numba adds too, is done as in numba's own compiler (decision 0089).
"""

from __future__ import annotations

from numba.core.compiler import CompilerBase, DefaultPassBuilder
from numba.core.compiler_machinery import PassManager

LEFT_OUT = {"InlineClosureLikes", "GenericRewrites", "InlineOverloads", "NopythonRewrites"}
"""Steps that look for something in every function and find nothing in a loop over numbers."""


class LoopCompiler(CompilerBase):  # type: ignore[misc]
    """numba's compiler for functions that are loops over numbers and elements of arrays."""

    def define_pipelines(self) -> list[PassManager]:
        """The steps of a compilation."""
        manager = DefaultPassBuilder.define_nopython_pipeline(self.state)
        manager.passes = [entry for entry in manager.passes if entry[0].__name__ not in LEFT_OUT]
        manager.finalize()
        return [manager]
