"""Functions that compiled code calls: in Python they stay what they are.

numba's own way to this, ``overload``, makes of each function finished machine code: optimised,
with what it calls inside, and with an entry for Python. No one uses that, for whatever calls the
function takes its intermediate code in, and optimises the whole again. It does so once for each
set of options that a caller is compiled with, and hands on to routines that they be inlined where
one of their callers is. So here a function is compiled once for each signature, as far as it is
linked; the kernel in which it ends up optimises all of it together.

That takes names which numba does not publish. Where one is gone, ``overload`` does: compilation
takes longer, results have the same bits.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from numba import njit
from numba.extending import overload


def understood(options: dict[str, Any]) -> dict[str, Any]:
    """Return the options of compilation that numba has; what it does not document only saves time.

    Others would be refused when a kernel is compiled.
    """
    try:
        from numba.core.cpu import CPUTargetOptions
    except ImportError:
        return options
    return {name: value for name, value in options.items() if hasattr(CPUTargetOptions, name)}


try:
    from phasekit.numerics.intermediate import LinkedCompiler, register

    _register: Any = register
except ImportError:
    OPTIONS: Any = {}
    _register = None
else:
    OPTIONS = {"pipeline_class": LinkedCompiler, **understood({"no_cpython_wrapper": True})}


def link(
    function: Callable[..., Any], body: Callable[..., Any], *, literal: bool = False, **options: Any
) -> None:
    """Let compiled code that calls a function call a body, compiled with these options.

    With ``literal``, anew for each integer that is written out where it is called.
    """
    known: Any = understood(options)
    if _register is not None:
        _register(function, njit(**OPTIONS, **known)(body), literal=literal)
        return
    overload(function, jit_options=known, strict=False, prefer_literal=literal)(lambda *args: body)
