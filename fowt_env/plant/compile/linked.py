"""Compiles kernels called by kernels: to LLVM bitcode that callers link, or to machine code that they call.

Numba generates machine code for each kernel. Where kernels alone call a kernel, that code is never run, as
each caller has a copy, but takes 40 % of the compile time of a scene. Such a kernel is compiled to bitcode
only, which callers link and the disk cache stores; calls from Python, as in tests, compile it separately.

A large kernel with many callers is compiled to machine code once instead, and callers have its name only.
"""

import hashlib
from functools import cached_property
from importlib import import_module
from typing import NamedTuple

import llvmlite.binding as llvm
import numba
from llvmlite import ir
from numba.core import event, sigutils
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompilerBase, CompileResult, DefaultPassBuilder
from numba.core.compiler_lock import global_compiler_lock
from numba.core.compiler_machinery import register_pass
from numba.core.errors import ForceLiteralArg
from numba.core.registry import CPUDispatcher
from numba.core.typed_passes import NativeLowering

from fowt_env.plant.compile.signatures import remembered_signatures


class LinkedLibrary(JITCodeLibrary):
    """Holds the LLVM bitcode of a kernel for its callers to link; generates no machine code."""

    def _finalize_final_module(self):
        self._finalize_dynamic_globals()
        self._verify_declare_only_symbols()
        self._finalized = True

    def _optimize_final_module(self):
        """Skip optimisation: the caller with machine code optimises all linked kernels at once."""

    def serialized(self):
        """Return (name, LLVM bitcode) of the library for the disk cache."""
        return self.name, self._get_module_for_linking().as_bitcode()

    @classmethod
    def rebuilt(cls, codegen, name, code):
        """Return the LinkedLibrary of a serialized name and LLVM bitcode."""
        library = cls(codegen, name)
        library._final_module = library._shared_module = llvm.parse_bitcode(code)
        library._finalize_final_module()
        return library


def place_environment(codegen, name, environment):
    """Define the variable through which a kernel reads its Environment, as a print needs.

    Among variables with common linkage in several modules the first counts, so callers use this one.
    """
    module = codegen._create_empty_module(name)
    variable = ir.GlobalVariable(module, ir.IntType(8).as_pointer(), name)
    variable.linkage = "common"
    variable.initializer = ir.Constant(variable.value_type, None)
    codegen._add_module(llvm.parse_assembly(str(module)))
    codegen._engine.finalize_object()
    codegen.set_env(name, environment)


class SeparateLibrary(JITCodeLibrary):
    """Holds the machine code of a kernel that callers call by name: they link nothing."""

    def __init__(self, codegen, name):
        super().__init__(codegen, name)
        self.enable_object_caching()

    def _get_module_for_linking(self):
        return llvm.parse_assembly(str(self._codegen._create_empty_module(self.name)))

    def serialized(self):
        """Return (name, object code) of the library for the disk cache."""
        return self.name, self._get_compiled_object()

    @classmethod
    def rebuilt(cls, codegen, name, code):
        """Return the SeparateLibrary of a serialized name and object code."""
        library = cls(codegen, name)
        library._set_compiled_object(code)
        library._finalize_final_module()
        return library


class Key:
    """Identifies a linked kernel where numba has the function that Python calls."""


@register_pass(mutates_CFG=True, analysis_only=False)
class LinkedLowering(NativeLowering):
    """Runs numba's lowering pass with a LinkedLibrary as its target."""

    _name = "linked_lowering"
    library: type = LinkedLibrary

    def run_pass(self, state):
        state.library = self.library(state.targetctx.codegen(), state.func_id.func_qualname)
        state.flags.no_compile = state.flags.no_cpython_wrapper = state.flags.no_cfunc_wrapper = True
        super().run_pass(state)
        lowered, key = state["cr"], Key()
        state.targetctx.insert_user_function(key, lowered.fndesc, [state.library])
        state["cr"] = lowered._replace(cfunc=key)
        place_environment(state.library.codegen, state.targetctx.get_env_name(lowered.fndesc), lowered.env)
        state.library.finalize()
        state.reload_init.extend(state.library._reload_init)  # of the kernels that it links
        return True


class LinkedCompiler(CompilerBase):
    """Runs numba's compiler pipeline with LinkedLowering as its last pass."""

    lowering: type = LinkedLowering
    stored: str = "linked"  # in the names of files of the disk cache

    def define_pipelines(self):
        passes = DefaultPassBuilder.define_nopython_pipeline(self.state)
        passes.passes = [
            (self.lowering, "linked lowering") if kind is NativeLowering else (kind, text)
            for kind, text in passes.passes
        ]
        passes.finalize()
        return [passes]


@register_pass(mutates_CFG=True, analysis_only=False)
class SharedLowering(LinkedLowering):
    """Runs LinkedLowering of a kernel that callers link but LLVM never inlines."""

    _name = "shared_lowering"

    def run_pass(self, state):
        state.flags.forceinline = False  # a kernel that an inlined one calls inherits this option
        super().run_pass(state)
        module = state.library._final_module
        module.get_function(state["cr"].fndesc.llvm_func_name).add_function_attribute("noinline")
        return True


class SharedCompiler(LinkedCompiler):
    """Runs numba's compiler pipeline with SharedLowering as its last pass."""

    lowering = SharedLowering


class Load(NamedTuple):
    """Loads a separate kernel, or compiles it, before the code of a caller is loaded from disk."""

    module: str
    name: str
    arguments: tuple  # numba types

    def __call__(self):
        getattr(import_module(self.module), self.name).compile(self.arguments)


@register_pass(mutates_CFG=True, analysis_only=False)
class SeparateLowering(LinkedLowering):
    """Runs numba's lowering pass with a SeparateLibrary, of one name in all processes."""

    _name = "separate_lowering"
    library = SeparateLibrary

    def run_pass(self, state):
        state.flags.forceinline = False  # as in SharedLowering
        function = state.func_id
        # numba's number of a function depends on what a process has compiled before
        function.unique_id = hashlib.sha256(repr(state.args).encode()).hexdigest()[:16]
        super().run_pass(state)
        state.library._reload_init = {Load(function.modname, function.func_qualname, state.args)}
        return True


class SeparateCompiler(LinkedCompiler):
    """Runs numba's compiler pipeline with SeparateLowering as its last pass."""

    lowering = SeparateLowering
    stored = "separate"


class LinkedDispatcher(CPUDispatcher):
    """Dispatches calls to a linked kernel: from kernels to its bitcode, from Python to its twin."""

    def __init__(self, py_func, locals=None, targetoptions=None, pipeline_class=LinkedCompiler):
        super().__init__(py_func, locals, targetoptions, pipeline_class)
        self.stored = pipeline_class.stored
        self.keep = None  # keep(compiled, function): attaches the disk cache to the twin
        self._called_from_python = False

    @cached_property
    def twin(self):
        """Return the dispatcher of the same function compiled by numba for calls from Python."""
        twin = numba.jit(**self.targetoptions)(self.py_func)
        if self.keep is not None:
            self.keep(twin, self.py_func)
        return twin

    def add_overload(self, cres):
        """Register an overload for kernels only: calls from Python do not use it."""
        self.overloads[tuple(cres.signature.args)] = cres

    def _compile_for_args(self, *args, **kws):
        with global_compiler_lock:  # reentrant lock of numba: another thread may compile for kernels
            self._called_from_python = True
            try:
                return super()._compile_for_args(*args, **kws)
            finally:
                self._called_from_python = False

    def _compiled(self, sig):
        """Compile for a signature, unless it is in memory or on disk, and return the Key of the bitcode.

        As CPUDispatcher.compile, which also starts two timers for each kernel being compiled: LLVM's lock
        then reports every call to those of all callers, too, a tenth of the compile time.
        """
        args, return_type = sigutils.normalize_signature(sig)
        if (known := self.overloads.get(tuple(args))) is not None:
            return known.entry_point
        with self._compiling_counter:
            result = self._cache.load_overload(sig, self.targetctx)
            if result is not None:
                self._cache_hits[sig] += 1
                self.targetctx.insert_user_function(result.entry_point, result.fndesc, [result.library])
                self.add_overload(result)
                return result.entry_point
            self._cache_misses[sig] += 1
            details = {"dispatcher": self, "args": args, "return_type": return_type}
            with event.trigger_event("numba:compile", data=details):
                try:
                    result = self._compiler.compile(args, return_type)
                except ForceLiteralArg as error:
                    fold = self._compiler.fold_argument_types
                    raise error.bind_fold_arguments(lambda args, kws: fold(args, kws)[1]) from None
                self.add_overload(result)
            self._cache.save_overload(sig, result)
            return result.entry_point

    def compile(self, sig):
        """Compile for a signature; return the Key of the bitcode or, called from Python, the function."""
        if not self._called_from_python:
            with global_compiler_lock, remembered_signatures():
                return self._compiled(sig)
        self._called_from_python = False  # its callees are compiled for kernels
        args, _ = sigutils.normalize_signature(sig)
        function = self.twin.compile(tuple(args))
        self._insert([kind._code for kind in args], function, False)
        return function


def reduced(cres):
    """Return the parts of a linked or separate kernel's CompileResult that can be pickled."""
    descriptor, library = cres.fndesc, cres.library
    descriptor.typemap = descriptor.calltypes = None
    return type(library), library.serialized(), descriptor, cres.environment, cres.signature, cres.reload_init


def rebuilt(target_context, parts):
    """Return the CompileResult of a linked or separate kernel from its reduced parts."""
    kind, (name, code), descriptor, environment, signature, reload_init = parts
    for function in reload_init:
        function()
    codegen = target_context.codegen()
    place_environment(codegen, target_context.get_env_name(descriptor), environment)
    library = kind.rebuilt(codegen, name, code)
    load = Load(descriptor.modname, descriptor.qualname, signature.args)
    library._reload_init = {load} if kind is SeparateLibrary else set(reload_init)
    empty = dict.fromkeys(CompileResult._fields)
    return CompileResult(
        **empty
        | {
            "target_context": target_context, "typing_context": target_context.typing_context,
            "library": library, "environment": environment, "entry_point": Key(), "fndesc": descriptor,
            "type_annotation": "", "signature": signature, "objectmode": False, "lifted": (),
            "reload_init": reload_init, "referenced_envs": (),
        }
    )  # fmt: skip
