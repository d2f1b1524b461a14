"""What Python calls: it takes the arguments of a kernel apart, and puts its results together.

The code reads arrays as the C interface of NumPy lays them out, and numbers by functions of
Python's C interface, without the interpreter in between: a call costs less than a microsecond. It
gives back `NotImplemented` where an argument is of another kind than the form was compiled for.
Where objects of this Python are not laid out so, `frame` takes numbers and addresses in one array.
"""

from __future__ import annotations

import ctypes
import functools
import sys
from typing import Any

import numpy as np

from phasekit.numerics.compiler.kinds import (
    BOOL,
    COMPLEX,
    ELEMENTS,
    FLOAT,
    INT,
    NONE,
    Array,
    CompileError,
    Kind,
    Tuple,
    described,
    split,
)
from phasekit.numerics.compiler.program import Form

_TYPES: dict[str, Any] = {
    "ndarray": np.ndarray,
    "float": float,
    "float64": np.float64,
    "int": int,
    "int64": np.int64,
    "bool": bool,
    "bool_": np.bool_,
    "tuple": tuple,
    "complex": complex,
    "complex128": np.complex128,
    "None": None,
    "NotImplemented": NotImplemented,
}
_FUNCTIONS = (
    "PyFloat_AsDouble",
    "PyLong_AsLongLong",
    "PyObject_IsTrue",
    "PyErr_Occurred",
    "PyComplex_RealAsDouble",
    "PyComplex_ImagAsDouble",
    "PyEval_SaveThread",
    "PyEval_RestoreThread",
    "PyFloat_FromDouble",
    "PyLong_FromLongLong",
    "PyBool_FromLong",
    "PyComplex_FromDoubles",
    "PyTuple_New",
    "PyTuple_SetItem",
    "Py_IncRef",
)
_PLACES = {name: i for i, name in enumerate((*_TYPES, *_FUNCTIONS))}
#: Sizes of the head that all objects have; the type stands at its end.
HEAD = object.__basicsize__
#: Where a tuple has its items: behind its length, and from Python 3.14 on behind its hash.
ITEMS = tuple.__basicsize__
_WHOLE, _ALIGNED, _WRITEABLE = 0x1, 0x100, 0x400


@functools.cache
def addresses() -> Any:
    """Addresses of what the entries use, in their order."""
    known = [id(value) for value in _TYPES.values()]
    for name in _FUNCTIONS:
        known.append(ctypes.cast(getattr(ctypes.pythonapi, name), ctypes.c_void_p).value or 0)
    return (ctypes.c_int64 * len(known))(*known)


@functools.cache
def readable() -> bool:
    """Whether objects are laid out as the entries read them."""
    sample = np.zeros((3, 5), np.int16)
    pair = sample, sample.dtype
    items = [id(one) for one in pair]

    def read(kind: Any, address: int) -> Any:
        return kind.from_address(address).value

    try:
        start = id(sample) + HEAD
        dtype = read(ctypes.c_void_p, start + 40) + HEAD
        dims, strides = (read(ctypes.c_void_p, start + offset) for offset in (16, 24))
        return (
            read(ctypes.c_void_p, id(sample) + HEAD - 8) == id(np.ndarray)
            and read(ctypes.c_void_p, start) == sample.ctypes.data
            and read(ctypes.c_int, start + 8) == 2
            and [read(ctypes.c_int64, dims + 8 * i) for i in range(2)] == [3, 5]
            and [read(ctypes.c_int64, strides + 8 * i) for i in range(2)] == [10, 2]
            and read(ctypes.c_int, dtype + 12) == sample.dtype.num
            and read(ctypes.c_char, dtype + 10) == sample.dtype.byteorder.encode()
            and read(ctypes.c_int, start + 48) & 0x501 == 0x501
            and read(ctypes.c_int64, id(pair) + HEAD) == 2
            and [read(ctypes.c_void_p, id(pair) + ITEMS + 8 * i) for i in range(2)] == items
        )
    except (TypeError, ValueError):
        return False


class _Entry:
    """Writes the entry of a form."""

    def __init__(self) -> None:
        self.lines: list[str] = []
        self.count = 0
        self.used: dict[str, str] = {}

    def op(self, text: str) -> str:
        self.count += 1
        self.lines.append(f"  %t{self.count} = {text}")
        return f"%t{self.count}"

    def do(self, text: str) -> None:
        self.lines.append(f"  {text}")

    def load(self, base: str, offset: int, kind: str) -> str:
        place = self.op(f"getelementptr i8, ptr {base}, i64 {offset}")
        return self.op(f"load {kind}, ptr {place}")

    def python(self, name: str) -> str:
        """The address of a type, an object or a function of Python's."""
        return self.load("@python", 8 * _PLACES[name], "ptr")

    def demand(self, condition: str) -> None:
        """Go on only if it holds."""
        self.count += 1
        self.do(f"br i1 {condition}, label %b{self.count}, label %other")
        self.lines.append(f"b{self.count}:")

    def demand_type(self, x: str, *names: str) -> None:
        kind = self.load(x, HEAD - 8, "ptr")
        found = None
        for name in names:
            same = self.op(f"icmp eq ptr {kind}, {self.python(name)}")
            found = same if found is None else self.op(f"or i1 {found}, {same}")
        assert found is not None
        self.demand(found)

    def numbers(self, kind: Kind, x: str) -> list[str]:
        """The parts of an argument."""
        if isinstance(kind, Tuple):
            self.demand_type(x, "tuple")
            length = self.load(x, HEAD, "i64")
            self.demand(self.op(f"icmp eq i64 {length}, {len(kind.kinds)}"))
            found = []
            for i, one in enumerate(kind.kinds):
                found += self.numbers(one, self.load(x, ITEMS + 8 * i, "ptr"))
            return found
        if isinstance(kind, Array):
            return self.array(kind, x)
        if kind == NONE:
            self.demand(self.op(f"icmp eq ptr {x}, {self.python('None')}"))
            return []
        if kind == FLOAT:
            self.demand_type(x, "float", "float64")
            return [self.op(f"call double {self.python('PyFloat_AsDouble')}(ptr {x})")]
        if kind == INT:
            self.demand_type(x, "int", "int64")
            value = self.op(f"call i64 {self.python('PyLong_AsLongLong')}(ptr {x})")
            self.count += 1
            failed, fine = f"f{self.count}", f"g{self.count}"
            odd = self.op(f"icmp eq i64 {value}, -1")
            self.do(f"br i1 {odd}, label %{failed}, label %{fine}")
            self.lines.append(f"{failed}:")
            error = self.op(f"call ptr {self.python('PyErr_Occurred')}()")
            none = self.op(f"icmp eq ptr {error}, null")
            self.do(f"br i1 {none}, label %{fine}, label %raised")
            self.lines.append(f"{fine}:")
            return [value]
        if kind == BOOL:
            self.demand_type(x, "bool", "bool_")
            value = self.op(f"call i32 {self.python('PyObject_IsTrue')}(ptr {x})")
            return [self.op(f"icmp ne i32 {value}, 0")]
        if kind == COMPLEX:
            self.demand_type(x, "complex", "complex128")
            names = "PyComplex_RealAsDouble", "PyComplex_ImagAsDouble"
            return [self.op(f"call double {self.python(name)}(ptr {x})") for name in names]
        raise CompileError(f"a kernel takes no {described(kind)}")

    def array(self, kind: Array, x: str) -> list[str]:
        self.demand_type(x, "ndarray")
        ndim = self.load(x, HEAD + 8, "i32")
        descr = self.load(x, HEAD + 40, "ptr")
        number = self.load(descr, HEAD + 12, "i32")
        order = self.load(descr, HEAD + 10, "i8")
        flags = self.load(x, HEAD + 48, "i32")
        mask = self.op(f"and i32 {flags}, {_WHOLE | _ALIGNED}")
        own = "<" if sys.byteorder == "little" else ">"
        native = [self.op(f"icmp eq i8 {order}, {ord(one)}") for one in ("=", "|", own)]
        either = self.op(f"or i1 {native[0]}, {native[1]}")
        tests = [
            self.op(f"icmp eq i32 {ndim}, {kind.ndim}"),
            self.op(f"icmp eq i32 {number}, {np.dtype(kind.code).num}"),
            self.op(f"icmp eq i32 {mask}, {_ALIGNED | (_WHOLE if kind.whole else 0)}"),
            self.op(f"or i1 {either}, {native[2]}"),
        ]
        found = tests[0]
        for test in tests[1:]:
            found = self.op(f"and i1 {found}, {test}")
        self.demand(found)
        parts = [self.load(x, HEAD, "ptr")]
        for offset in (16,) if kind.whole else (16, 24):
            first = self.load(x, HEAD + offset, "ptr")
            parts += [self.load(first, 8 * i, "i64") for i in range(kind.ndim)]
        return parts

    def object(self, kind: Kind, parts: tuple[str, ...]) -> str:
        """A new reference to a result."""
        if isinstance(kind, Tuple):
            found = self.op(f"call ptr {self.python('PyTuple_New')}(i64 {len(kind.kinds)})")
            for i, value in enumerate(split(kind, parts)):
                one = self.object(value.kind, value.parts)
                self.op(
                    f"call i32 {self.python('PyTuple_SetItem')}(ptr {found}, i64 {i}, ptr {one})"
                )
            return found
        if kind == NONE:
            none = self.python("None")
            self.do(f"call void {self.python('Py_IncRef')}(ptr {none})")
            return none
        if kind == FLOAT:
            return self.op(f"call ptr {self.python('PyFloat_FromDouble')}(double {parts[0]})")
        if kind == INT:
            return self.op(f"call ptr {self.python('PyLong_FromLongLong')}(i64 {parts[0]})")
        if kind == BOOL:
            wide = self.op(f"zext i1 {parts[0]} to i64")
            return self.op(f"call ptr {self.python('PyBool_FromLong')}(i64 {wide})")
        if kind == COMPLEX:
            both = ", ".join(f"double {part}" for part in parts)
            return self.op(f"call ptr {self.python('PyComplex_FromDoubles')}({both})")
        raise CompileError(f"a kernel returns no {described(kind)}; let it fill arrays")


def entry_text(form: Form, kinds: tuple[Kind, ...]) -> str:
    """The entry of a form from Python."""
    entry = _Entry()
    parts: list[str] = []
    for i, kind in enumerate(kinds):
        parts += entry.numbers(kind, entry.load("%args", 8 * i, "ptr"))
    thread = entry.op(f"call ptr {entry.python('PyEval_SaveThread')}()")
    results = _call(entry, form, kinds, parts)
    entry.do(f"call void {entry.python('PyEval_RestoreThread')}(ptr {thread})")
    entry.do(f"ret ptr {entry.object(form.result, results)}")
    entry.lines.append("other:")
    other = entry.python("NotImplemented")
    entry.do(f"call void {entry.python('Py_IncRef')}(ptr {other})")
    entry.do(f"ret ptr {other}")
    entry.lines.append("raised:")
    entry.do("ret ptr null")
    head = [
        f"@python = global [{len(_PLACES)} x ptr] zeroinitializer",
        "define ptr @entry(ptr %self, ptr %args, i64 %count) {",
        f"  %enough = icmp eq i64 %count, {len(kinds)}",
        "  br i1 %enough, label %start, label %other",
        "start:",
    ]
    return "\n".join([*head, *entry.lines, "}"])


def _call(entry: _Entry, form: Form, kinds: tuple[Kind, ...], parts: list[str]) -> tuple[str, ...]:
    types = [one for kind in kinds for one in kind.types]
    given = ", ".join(f"{one} {part}" for one, part in zip(types, parts, strict=True))
    returned = form.result.types
    if not returned:
        entry.do(f"call void @{form.symbol}({given})")
        return ()
    if len(returned) == 1:
        return (entry.op(f"call {returned[0]} @{form.symbol}({given})"),)
    struct = f"{{{', '.join(returned)}}}"
    found = entry.op(f"call {struct} @{form.symbol}({given})")
    return tuple(entry.op(f"extractvalue {struct} {found}, {i}") for i in range(len(returned)))


def frame_text(form: Form, kinds: tuple[Kind, ...]) -> str:
    """The entry that takes numbers and addresses in one array, behind which it leaves results."""
    entry = _Entry()
    parts = []
    types = [one for kind in kinds for one in kind.types]
    for i, one in enumerate(types):
        part = entry.load("%frame", 8 * i, "i64" if one == "i1" else one)
        parts.append(entry.op(f"trunc i64 {part} to i1") if one == "i1" else part)
    results = _call(entry, form, kinds, parts)
    for i, (one, part) in enumerate(zip(form.result.types, results, strict=True)):
        place = entry.op(f"getelementptr i8, ptr %frame, i64 {8 * (len(types) + i)}")
        if one == "i1":
            one, part = "i64", entry.op(f"zext i1 {part} to i64")
        entry.do(f"store {one} {part}, ptr {place}")
    return "\n".join(["define void @frame(ptr %frame) {", *entry.lines, "  ret void", "}"])


def plain_text(form: Form, kinds: tuple[Kind, ...]) -> str:
    """The entry of a function of pointers from other machine code."""
    types = ", ".join(f"ptr %a{i}" for i in range(len(kinds)))
    return f"define void @plain({types}) {{\n  call void @{form.symbol}({types})\n  ret void\n}}"


def code_of(dtype: Any) -> str | None:
    """The name of a type of entries; None of those that kernels do not take."""
    code = f"{dtype.kind}{dtype.itemsize}"
    return code if code in ELEMENTS and dtype.isnative else None
