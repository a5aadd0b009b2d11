"""Code of kernels, optimised once, and of their steps: none of the processor's, for each caller holds it in its own.

When to use: as a step of ``passes.LoopCompiler``. When not: for functions whose compilation has to be numba's own.

numba makes machine code of every function when it has compiled it, and that of its callers from the intermediate code
of both. Of a step without a wrapper for Python the first is never run. What it would leave undone is what numba does
when it takes kernels from its disk: to give the caller's code the environments (the objects of Python that a function
refers to) of the steps in it (decision 0095). Nor is a step optimised as a whole: its callers are, with it in them
(decision 0098).
"""

from __future__ import annotations

from typing import Any

from llvmlite import binding as llvm
from numba.core.codegen import JITCodeLibrary, RuntimeLinker
from numba.core.compiler_machinery import register_pass
from numba.core.environment import lookup_environment
from numba.core.typed_passes import NativeLowering

from mbf_abstract.compiling.known_types import KnownOperators

TIDYING = ("sroa", "instruction_combine", "simplify_cfg", "global_dead_code_eliminate")
"""LLVM's passes over the code of a step: from memory to registers, and without what nobody uses."""
_ENVIRONMENT = "_ZN08NumbaEnv"
"""How the variables begin that hold the address of an environment, as in numba's own ``CompileResult``."""


def _chosen_passes() -> Any:
    """LLVM's passes of ``TIDYING``; None with an llvmlite of before 2025, which has none to choose from."""
    manager: Any = getattr(llvm, "create_new_module_pass_manager", lambda: None)()
    if not all(hasattr(manager, f"add_{name}_pass") for name in TIDYING):
        return None
    for name in TIDYING:
        getattr(manager, f"add_{name}_pass")()
    return manager


class KernelLibrary(JITCodeLibrary):  # type: ignore[misc]
    """Code of a kernel with all steps that it calls."""

    def _optimize_functions(self, ll_module: Any) -> None:
        """Leave out what numba does for each function of a module, and again when it optimises the whole module.

        An llvmlite of before 2025 makes other code of that.
        """
        if _chosen_passes() is None:
            super()._optimize_functions(ll_module)
        else:
            ll_module.data_layout = self._codegen._data_layout

    def _finalize_specific(self) -> None:
        super()._finalize_specific()
        for variable in self._final_module.global_variables:
            name = variable.name
            if name.startswith(_ENVIRONMENT) and (environment := lookup_environment(name)) is not None:
                self._codegen.set_env(name, environment)


class _NoMachineCode:
    """Takes the place of what gives machine code its environment, where there is no machine code."""

    def set_env(self, _name: str, _environment: object) -> None:
        """Nothing to do: the callers' code gets it."""


class StepLibrary(KernelLibrary):
    """Code of a step, to be linked into that of kernels; it is not run by itself."""

    codegen = _NoMachineCode()

    def _optimize_final_module(self) -> None:
        """Leave to LLVM's whole optimisation of the callers what is not done by ``TIDYING``."""
        manager = _chosen_passes()
        if manager is None:
            super()._optimize_final_module()
        else:
            manager.run(self._final_module, self._codegen._pass_builder(opt=0))

    def _finalize_final_module(self) -> None:
        self._finalize_dynamic_globals()
        self._verify_declare_only_symbols()
        if any(variable.name.startswith(RuntimeLinker.PREFIX) for variable in self._final_module.global_variables):
            raise NotImplementedError(f"{self.name} calls itself by way of another step: give it a wrapper for Python")
        self._finalized = True

    def get_pointer_to_function(self, _name: str) -> int:
        """Address of a function: 0, there is no wrapper for Python."""
        self._ensure_finalized()
        return 0

    def serialize_using_object_code(self) -> tuple[str, str, bytes]:
        """What is kept on disk."""
        self._ensure_finalized()
        return self.name, "bitcode", self._final_module.as_bitcode()


class WholeKernelLibrary(KernelLibrary):
    """Code of a kernel whose functions are optimised one by one, too."""

    def _optimize_functions(self, ll_module: Any) -> None:
        JITCodeLibrary._optimize_functions(self, ll_module)


class WholeStepLibrary(StepLibrary):
    """Code of a step that is optimised as a whole before its callers are, with it in them."""

    def _optimize_functions(self, ll_module: Any) -> None:
        JITCodeLibrary._optimize_functions(self, ll_module)

    def _optimize_final_module(self) -> None:
        KernelLibrary._optimize_final_module(self)


@register_pass(mutates_CFG=True, analysis_only=False)
class KernelLowering(NativeLowering):  # type: ignore[misc]
    """numba's step from its own code to the processor's, which steps of other kernels leave half-way."""

    lowering_class = KnownOperators
    kernel_library: type[KernelLibrary] = KernelLibrary
    step_library: type[StepLibrary] = StepLibrary

    def run_pass(self, state: Any) -> bool:
        """Make the code of a function."""
        kind = self.step_library if state.flags.no_cpython_wrapper else self.kernel_library
        state.library = kind(state.targetctx.codegen(), state.func_id.func_qualname)
        state.library.enable_object_caching()
        return bool(super().run_pass(state))


@register_pass(mutates_CFG=True, analysis_only=False)
class WholeStepLowering(KernelLowering):
    """The same, with steps and kernels that are optimised function by function and as a whole."""

    kernel_library = WholeKernelLibrary
    step_library = WholeStepLibrary
