"""Compiled forms of kernels: made, kept on disk, and taken into this process."""

from __future__ import annotations

import contextlib
import ctypes
import os
from collections.abc import Callable
from typing import Any, cast

from phasekit.numerics import kept, waits
from phasekit.numerics.compiler import entry, machine
from phasekit.numerics.compiler.kinds import Kind, Tuple, described
from phasekit.numerics.compiler.program import Form, Program
from phasekit.numerics.values import normal, numbers_of, value_of

Function = Callable[..., Any]


class _Method(ctypes.Structure):
    """How Python's C interface describes a function."""

    _fields_ = (
        ("name", ctypes.c_char_p),
        ("function", ctypes.c_void_p),
        ("flags", ctypes.c_int),
        ("doc", ctypes.c_char_p),
    )


_FASTCALL = 0x80
#: Effort of the quick form.
QUICK = 0
#: Whether compiled code stops the process at an index outside an array: to find mistakes.
CHECKED = os.environ.get("PHASEKIT_CHECK_INDICES", "0") not in ("", "0")


def python_function(
    function: Function, kinds: tuple[Kind, ...], effort: int, *, make: bool
) -> Function | None:
    """A function compiled for kinds of arguments, for Python to call; None if none is kept.

    With `make` it is compiled if no process did.
    """
    if not entry.readable():
        return _framed(function, kinds, effort) if make else None
    found = _loaded(function, kinds, effort, entry.entry_text, ("entry", "python"), make=make)
    if found is None:
        return None
    table = entry.addresses()
    ctypes.memmove(found["python"], table, ctypes.sizeof(table))
    method = _Method(function.__name__.encode(), found["entry"], _FASTCALL, None)
    # A function looks there even when it is given back, and the interpreter ends in no fixed order.
    ctypes.pythonapi.Py_IncRef(ctypes.py_object(method))
    new = ctypes.pythonapi.PyCFunction_NewEx
    new.restype, new.argtypes = ctypes.py_object, (ctypes.c_void_p,) * 3
    return cast(Function, new(ctypes.addressof(method), None, None))


def _framed(function: Function, kinds: tuple[Kind, ...], effort: int) -> Function:
    """The same where objects of this Python are not laid out as entries read them."""
    program = Program()
    form = program.form(function, kinds, inlined=False)
    image = machine.assemble(program.text(entry.frame_text(form, kinds)), effort)
    if effort == QUICK:
        _BYTES[function, kinds] = len(image)
    run = ctypes.CFUNCTYPE(None, ctypes.c_void_p)(machine.load(image, ("frame",))["frame"])

    def call(*args: Any) -> Any:
        if tuple(normal(x)[1] for x in args) != kinds:
            return NotImplemented
        given = [n for x, kind in zip(args, kinds, strict=True) for n in numbers_of(x, kind)]
        frame = (ctypes.c_int64 * (len(given) + len(form.result.types) + 1))(*given)
        run(ctypes.addressof(frame))
        return value_of(form.result, iter(frame[len(given) :]))

    return call


def native_function(function: Function, kinds: tuple[Kind, ...]) -> int:
    """The address of a function of pointers that is compiled for other machine code to call."""
    found = _loaded(function, kinds, 1, entry.plain_text, ("plain",), make=True)
    assert found is not None
    return found["plain"]


Text = Callable[[Form, tuple[Kind, ...]], str]


def _loaded(
    function: Function, kinds: tuple[Kind, ...], effort: int, write: Text,
    names: tuple[str, ...], *, make: bool,
) -> dict[str, int] | None:  # fmt: skip
    """Addresses of what a form defines, which is read or made."""
    name, form = _key_of(function, kinds, effort, names[0])
    image = kept.read(name, form)
    if image is None:
        if not make:
            return None
        image = _assembled(function, kinds, effort, write, name, form)
    if effort == QUICK:
        _BYTES[function, kinds] = len(image)
    found = machine.load(image, (*names, "gesv"))
    if found["gesv"]:
        from phasekit.numerics.lapack import fill_slot

        fill_slot(found["gesv"])
    return found


def _assembled(
    function: Function, kinds: tuple[Kind, ...], effort: int, write: Text, name: str, form: str
) -> bytes:
    program = Program(checked=CHECKED)
    text = program.text(write(program.form(function, kinds, inlined=False), kinds))
    cost = max(1.0, _SECONDS_A_LINE * text.count("\n"))
    what = f"compiling, about {cost:.0f} s, once on this machine"
    with waits.notice(what, logged=True) if effort else contextlib.nullcontext():
        image = machine.assemble(text, effort)
    kept.write(name, form, image, program.sources, program.constants)
    return image


#: Seconds a line, with effort.
_SECONDS_A_LINE = 1e-4
#: Sizes of quick forms, which say how long the finished ones take to compile, and seconds a byte.
_BYTES: dict[Any, int] = {}
_SECONDS_A_BYTE = 1.2e-5


def seconds_to_finish(function: Function, kinds: tuple[Kind, ...]) -> float:
    """About how long it takes to make the finished form of what has a quick one."""
    return _BYTES[function, kinds] * _SECONDS_A_BYTE


def file_of(function: Function, kinds: tuple[Kind, ...]) -> str:
    """The file in which the quick form is kept."""
    return kept.file_of(*_key_of(function, kinds, QUICK, "entry"))


def _key_of(function: Function, kinds: tuple[Kind, ...], effort: int, way: str) -> tuple[str, str]:
    """The name of a kernel and that of its form, by which it is kept."""
    name = f"{function.__module__}.{function.__qualname__}"
    return name, f"{described(Tuple(kinds))} {way} {effort}{' checked' * CHECKED}"
