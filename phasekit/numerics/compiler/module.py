"""What a module in LLVM's language holds besides functions: constants, declarations, memory."""

from __future__ import annotations

import hashlib
from typing import Any

import numpy as np

from phasekit.numerics.compiler.kinds import (
    BOOL,
    FLOAT,
    INT,
    Array,
    CompileError,
    Value,
    described,
    element_of,
    number,
)

#: Memory of arrays that a function makes: blocks in a list, which are given back at its end.
_MEMORY = """declare noalias ptr @malloc(i64)
declare noalias ptr @calloc(i64, i64)
declare void @free(ptr)
define internal noalias ptr @enlist(ptr %arena, ptr %block) {
  %before = load ptr, ptr %arena
  store ptr %before, ptr %block
  store ptr %block, ptr %arena
  %data = getelementptr i8, ptr %block, i64 16
  ret ptr %data
}
define internal noalias ptr @made(ptr %arena, i64 %bytes) nounwind {
  %all = add i64 %bytes, 16
  %block = call ptr @malloc(i64 %all)
  %data = call ptr @enlist(ptr %arena, ptr %block)
  ret ptr %data
}
define internal noalias ptr @cleared(ptr %arena, i64 %bytes) nounwind {
  %all = add i64 %bytes, 16
  %block = call ptr @calloc(i64 1, i64 %all)
  %data = call ptr @enlist(ptr %arena, ptr %block)
  ret ptr %data
}
define internal void @release(ptr %arena) nounwind {
entry:
  br label %head
head:
  %block = load ptr, ptr %arena
  %none = icmp eq ptr %block, null
  br i1 %none, label %end, label %next
next:
  %before = load ptr, ptr %block
  store ptr %before, ptr %arena
  call void @free(ptr %block)
  br label %head
end:
  ret void
}"""


class Module:
    """Declarations and constants, which functions share."""

    def __init__(self, *, checked: bool) -> None:
        self.checked = checked
        """Whether indices are checked: to find mistakes, not to run."""
        self.declared: dict[str, str] = {}
        self.tables: dict[int, tuple[Any, Value]] = {}
        self.constants: dict[tuple[str, str], str] = {}
        """What tells apart the constants that are used, by module and name."""

    def called(
        self, code: Any, function: Any, args: list[Value], named: dict[str | None, Value]
    ) -> Value:
        """What a function of ours gives."""
        raise NotImplementedError

    def library(self, code: Any, name: str, *parts: str) -> str:
        """Call a function of the C library."""
        doubles = ", ".join(["double"] * len(parts))
        self.declared[name] = f"declare double @{name}({doubles}) memory(none) nounwind willreturn"
        return code.op(f"call double @{name}({', '.join(f'double {part}' for part in parts)})")

    def intrinsic(self, code: Any, name: str, *parts: str) -> str:
        """An instruction of the processor."""
        doubles = ", ".join(["double"] * len(parts))
        self.declared[name] = f"declare double @llvm.{name}.f64({doubles})"
        return code.op(
            f"call double @llvm.{name}.f64({', '.join(f'double {part}' for part in parts)})"
        )

    def allocator(self, *, cleared: bool) -> str:
        """The function that gives memory."""
        self.declared["memory"] = _MEMORY
        return "cleared" if cleared else "made"

    def at_once(self) -> str:
        """What marks a loop whose turns the processor is to take side by side."""
        self.declared["enable"] = '!0 = !{!"llvm.loop.vectorize.enable", i1 true}'
        name = f"!{len(self.declared)}"
        self.declared[name] = f"{name} = distinct !{{{name}, !0}}"
        return name

    def lapack(self) -> str:
        """Where the address of LAPACK's elimination will stand."""
        self.declared["gesv"] = "@gesv = global ptr null"
        return "gesv"

    def check(self, code: Any, index: str, length: str) -> None:
        """Stop the process where an index lies outside."""
        self.declared["trap"] = "declare void @llvm.trap() noreturn nounwind"
        inside, outside = code.fresh("b"), code.fresh("b")
        code.branch(code.op(f"icmp ult i64 {index}, {length}"), inside, outside)
        code.block(outside)
        code.do("call void @llvm.trap()")
        code.do("unreachable")
        code.open = False
        code.block(inside)

    def depends(self, space: dict[str, Any], name: str, found: Any) -> None:
        """Note a constant that the code holds."""
        self.constants[str(space["__name__"]), name] = constant_digest(found)

    def constant_array(self, array: Any) -> Value:
        """An array that does not change."""
        if id(array) not in self.tables:
            element, flat = element_of(array.dtype), array.ravel().tolist()
            texts = ", ".join(f"{element.stored} {_stored(element.kind, x)}" for x in flat)
            name = f"@table{len(self.tables)}"
            kind = f"[{len(flat)} x {element.stored}]"
            self.declared[name] = f"{name} = internal unnamed_addr constant {kind} [{texts}]"
            dims = map(str, array.shape)
            table = Value(Array(element.code, array.ndim), (name, *dims))
            self.tables[id(array)] = array, table  # which keeps it, and so its id
        return self.tables[id(array)][1]


def constant_digest(found: Any) -> str:
    """What tells a constant from another one."""
    if isinstance(found, np.ndarray):
        return hashlib.sha256(
            repr((found.dtype.str, found.shape)).encode() + found.tobytes()
        ).hexdigest()
    return repr(found.item() if isinstance(found, np.generic) else found)


def _stored(kind: Any, x: Any) -> str:
    if kind == FLOAT:
        return number(x)
    if kind in (INT, BOOL):
        return str(int(x))
    raise CompileError(f"constant arrays of {described(kind)} are not supported")
