"""numba's compiler, stopped at the code that is linked: by names that numba does not publish.

`phasekit.numerics.linked` does without this module where one of them is gone.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from numba import types
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler
from numba.core.typing.templates import AbstractTemplate, infer_global

if not all(
    hasattr(JITCodeLibrary, name)
    for name in (
        "_optimize_final_module",
        "_finalize_final_module",
        "_finalize_dynamic_globals",
        "_ensure_finalized",
    )
):
    raise ImportError("numba: its libraries of code are not what they were")


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


def register(function: Callable[..., Any], compiled: Any, *, literal: bool) -> None:
    """Let compiled code that calls a function call what `LinkedCompiler` made."""

    class Template(AbstractTemplate):
        key = function
        prefer_literal = literal

        def generic(self, args: Any, kws: Any) -> Any:
            return types.Dispatcher(compiled).get_call_type(self.context, args, kws)

        def get_impl_key(self, signature: Any) -> Any:
            return compiled.get_overload(signature.args)

    infer_global(function, types.Function(Template))  # type: ignore[no-untyped-call]
