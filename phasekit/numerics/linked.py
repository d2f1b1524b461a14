"""Functions that compiled code calls: in Python they stay what they are.

numba's own way to this, ``overload``, makes of each function finished machine code: optimised,
with what it calls inside, and with an entry for Python. No one uses that, for whatever calls the
function takes its intermediate code in, and optimises the whole again. It does so once for each
set of options that a caller is compiled with, and hands on to routines that they be inlined where
one of their callers is. So here a function is compiled once for each signature, as far as it is
linked; the kernel in which it ends up optimises all of it together.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from numba import njit, types
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler
from numba.core.typing.templates import AbstractTemplate, infer_global


class _LinkedLibrary(JITCodeLibrary):
    """Intermediate code that is neither optimised nor turned into machine code."""

    def _optimize_final_module(self) -> None:
        pass

    def _finalize_final_module(self) -> None:
        self._finalize_dynamic_globals()  # type: ignore[no-untyped-call]
        self._finalized = True

    def get_pointer_to_function(self, name: str) -> int:
        """There is no machine code to call."""
        self._ensure_finalized()  # type: ignore[no-untyped-call]
        return 0

    @property
    def codegen(self) -> Any:
        """What is asked to keep the environment of a function: this."""
        return self

    def set_env(self, name: str, environment: Any) -> None:
        """Nothing: an environment holds Python objects, of which kernels know none."""


class LinkedCompiler(Compiler):
    """numba's compiler, up to the code that is linked."""

    def __init__(self, typing: Any, target: Any, library: Any, *others: Any) -> None:
        library = library or _LinkedLibrary(target.codegen(), "linked")  # type: ignore[no-untyped-call]
        super().__init__(typing, target, library, *others)  # type: ignore[no-untyped-call]


OPTIONS: Any = {"pipeline_class": LinkedCompiler, "no_cpython_wrapper": True}


def link(
    function: Callable[..., Any], body: Callable[..., Any], *, literal: bool = False, **options: Any
) -> None:
    """Let compiled code that calls a function call a body, compiled with these options.

    With ``literal``, anew for each integer that is written out where it is called.
    """
    compiled = njit(**OPTIONS, **options)(body)

    class Template(AbstractTemplate):
        key = function
        prefer_literal = literal

        def generic(self, args: Any, kws: Any) -> Any:
            return types.Dispatcher(compiled).get_call_type(self.context, args, kws)

        def get_impl_key(self, signature: Any) -> Any:
            return compiled.get_overload(signature.args)

    infer_global(function, types.Function(Template))  # type: ignore[no-untyped-call]
