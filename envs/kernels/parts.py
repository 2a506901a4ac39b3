"""Parts of kernels: what only compiled code calls is linked into its callers, and nobody makes machine code of it by itself.

Numba optimizes every function that it compiles and makes machine code of it, together with all that it calls: of a loop at the
bottom of a kernel it does so once for each floor above. That was half of the time of the first start.
"""

from __future__ import annotations

from typing import Any

from numba.core.cgutils import ir  # ``ir``: numba's own builder of LLVM code
from numba.core.codegen import JITCodeLibrary, ll  # ``ll``: LLVM itself
from numba.core.compiler import CompilerBase, DefaultPassBuilder
from numba.core.compiler_machinery import FunctionPass, register_pass
from numba.core.untyped_passes import IRProcessing

ENVIRONMENT = "_ZN08NumbaEnv"  # numba writes to the variables of this name when a function is ready


class Part(JITCodeLibrary):
    """Code to link into others: left as it was written, for the kernel that holds it is optimized as a whole."""

    def _optimize_final_module(self) -> None:
        pass

    def _finalize_final_module(self) -> None:
        """Keep the code for those who link it; what becomes machine code is an empty module."""
        linked = self._final_module
        for function in linked.functions:
            if not function.is_declaration and function.linkage == ll.Linkage.external:
                function.linkage = ll.Linkage.linkonce_odr  # several kernels hold it
        rest = self._codegen._create_empty_module(self.name)
        for variable in linked.global_variables:
            if variable.name.startswith(ENVIRONMENT):
                own = ir.GlobalVariable(rest, ir.IntType(8).as_pointer(), variable.name)
                own.linkage = "common"
                own.initializer = ir.Constant(own.value_type, None)
        self._shared_module = linked
        self._final_module = ll.parse_assembly(str(rest))
        self._final_module.name = linked.name
        super()._finalize_final_module()


class OptimizedPart(Part):
    """The part of a kernel that Python calls, too: optimized by itself as that is, so that both round alike."""

    def _optimize_final_module(self) -> None:
        JITCodeLibrary._optimize_final_module(self)


class _MakeLibrary(FunctionPass):
    """Gives a function the library that its code goes into, before numba would."""

    kind: type[Part]

    def __init__(self) -> None:
        super().__init__()

    def run_pass(self, state: Any) -> bool:
        state.library = self.kind(state.targetctx.codegen(), state.func_id.func_qualname)
        state.library.enable_object_caching()
        return False


@register_pass(mutates_CFG=False, analysis_only=True)
class _MakePart(_MakeLibrary):
    _name = "tagtrack_make_part"
    kind = Part


@register_pass(mutates_CFG=False, analysis_only=True)
class _MakeOptimizedPart(_MakeLibrary):
    _name = "tagtrack_make_optimized_part"
    kind = OptimizedPart


class PartCompiler(CompilerBase):
    """Numba's compiler of functions, for parts."""

    library: type[_MakeLibrary] = _MakePart

    def define_pipelines(self) -> list[Any]:
        passes = DefaultPassBuilder.define_nopython_pipeline(self.state)
        passes.add_pass_after(self.library, IRProcessing)
        passes.finalize()
        return [passes]


class OptimizedPartCompiler(PartCompiler):
    library = _MakeOptimizedPart
