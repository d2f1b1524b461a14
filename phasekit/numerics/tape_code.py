"""Tapes to machine code, in time that grows with their length as it is.

A compiler's time grows faster than the length of a function. So code is written in pieces, which
hand each other what they need in memory that lasts for one call. They are compiled without effort,
which takes a sixth of the time: code that computes nothing twice runs as fast.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Mapping

import llvmlite.binding as llvm
from llvmlite import ir

from phasekit.numerics.machine_code import COMPARISONS, machine_code
from phasekit.numerics.tape import Node, Tape, arguments

PIECE = 400  # operations of a function
_POINTER = str(ir.DoubleType().as_pointer())
_ARRAYS = ("x", "p", "z")
_ARGUMENTS = ", ".join(f"{_POINTER} %{name}" for name in (*_ARRAYS, "out", "m"))
_PLAIN = {"add": "fadd", "sub": "fsub", "mul": "fmul", "div": "fdiv"}
_COMPARED = {"<": "olt", "<=": "ole", ">": "ogt", ">=": "oge", "==": "oeq", "!=": "one"}
_INTRINSIC = {"abs": "llvm.fabs.f64", "sqrt": "llvm.sqrt.f64"}
assert set(COMPARISONS.values()) == set(_COMPARED)


def compile_tape(tape: Tape, entries: Mapping[int, Node], count: int) -> int:
    """Address of ``void (double *x, double *p, double *z, double *out)``.

    Entries of the tape stand in so many places of ``out``; others become 0.
    """
    return machine_code(_Text(tape, entries, count).module(), host=False, effort=0)


class _Text:
    """The text of a module: pieces of the tape, and the function that calls them in turn."""

    def __init__(self, tape: Tape, entries: Mapping[int, Node], count: int) -> None:
        self.tape, self.entries, self.count = tape, entries, count
        self.declared: dict[str, str] = {}
        order = [k for k in tape.needed(entries.values()) if not tape.atom(k)]
        self.pieces = [order[i : i + PIECE] for i in range(0, len(order), PIECE)]
        self.home = {k: i for i, piece in enumerate(self.pieces) for k in piece}
        self.slots = self._slots()

    def _slots(self) -> dict[Node, int]:
        """Where each value lies that another piece takes; places serve again after the last."""
        last: dict[Node, int] = {}
        for i, piece in enumerate(self.pieces):
            for k in piece:
                for a in arguments(self.tape.operations[k]):
                    if self.home.get(a, i) != i:
                        last[a] = i
        slots: dict[Node, int] = {}
        free: list[int] = []
        ending: dict[int, list[int]] = {}
        self.memory = 0
        for i, piece in enumerate(self.pieces):
            free += ending.pop(i, [])
            for k in piece:
                if k in last:
                    if not free:
                        free.append(self.memory)
                        self.memory += 1
                    slots[k] = free.pop()
                    ending.setdefault(last[k] + 1, []).append(slots[k])
        return slots

    def module(self) -> str:
        """All of it."""
        outputs: dict[Node, list[int]] = {}
        for place, k in self.entries.items():
            outputs.setdefault(k, []).append(place)
        bodies = [self._piece(i, outputs) for i in range(len(self.pieces))]
        main = self._main({k: v for k, v in outputs.items() if k not in self.home})
        head = f'target triple = "{llvm.get_process_triple()}"'
        return "\n".join([head, *self.declared.values(), *bodies, main])

    def _piece(self, index: int, outputs: Mapping[Node, list[int]]) -> str:
        """One piece, which stores what others take and what is asked for."""
        lines = [f"define internal void @piece{index}({_ARGUMENTS}) {{"]
        here: dict[Node, str] = {}
        for k in self.pieces[index]:
            name, *args = self.tape.operations[k]
            here[k] = f"%v{k}"
            self._operation(lines, k, name, [self._value(lines, here, a) for a in args])
            for place in outputs.get(k, ()):
                _store(lines, f"%v{k}", "out", place, f"%o{place}")
            if k in self.slots:
                _store(lines, f"%v{k}", "m", self.slots[k], f"%s{k}")
        return "\n".join([*lines, "ret void", "}"])

    def _value(self, lines: list[str], here: dict[Node, str], a: Node) -> str:
        """What stands for an entry in a piece: a number, or a value that may have to be loaded."""
        if a in here:
            return here[a]
        operation = self.tape.operations[a]
        if operation[0] == "number":
            here[a] = _hex(operation[1])
            return here[a]
        where = (_ARRAYS[operation[1]], operation[2]) if operation[0] == "x" else None
        array, place = where or ("m", self.slots[a])
        lines.append(f"%q{a} = getelementptr double, {_POINTER} %{array}, i64 {place}")
        lines.append(f"%v{a} = load double, {_POINTER} %q{a}")
        here[a] = f"%v{a}"
        return here[a]

    def _operation(self, lines: list[str], k: Node, name: str, args: list[str]) -> None:
        to = f"%v{k} ="
        if name in _PLAIN:
            lines.append(f"{to} {_PLAIN[name]} double {args[0]}, {args[1]}")
        elif name == "neg":
            lines.append(f"{to} fneg double {args[0]}")
        elif name in _COMPARED:
            lines.append(f"%t{k} = fcmp {_COMPARED[name]} double {args[0]}, {args[1]}")
            lines.append(f"{to} uitofp i1 %t{k} to double")
        elif name == "select":
            lines.append(f"%t{k} = fcmp une double {args[0]}, {_hex(0.0)}")
            lines.append(f"{to} select i1 %t{k}, double {args[1]}, double {args[2]}")
        elif name in ("max", "min"):
            better = "ogt" if name == "max" else "olt"
            lines.append(f"%t{k} = fcmp {better} double {args[1]}, {args[0]}")
            lines.append(f"{to} select i1 %t{k}, double {args[1]}, double {args[0]}")
        else:
            called = _INTRINSIC.get(name, name)
            kinds = ", ".join(["double"] * len(args))
            self.declared.setdefault(called, f"declare double @{called}({kinds})")
            given = ", ".join(f"double {a}" for a in args)
            lines.append(f"{to} call double @{called}({given})")

    def _main(self, outputs: Mapping[Node, list[int]]) -> str:
        """What is called from outside; it stores entries that are arguments or numbers itself."""
        given = ", ".join(f"{_POINTER} %{name}" for name in (*_ARRAYS, "out"))
        lines = [f"define void @fill({given}) {{"]
        memory = f"{_POINTER} null"
        if self.memory:
            self.declared["malloc"] = f"declare {_POINTER} @malloc(i64)"
            self.declared["free"] = f"declare void @free({_POINTER})"
            lines.append(f"%m = call {_POINTER} @malloc(i64 {8 * self.memory})")
            memory = f"{_POINTER} %m"
        if len(self.entries) < self.count:
            self.declared["memset"] = f"declare {_POINTER} @memset({_POINTER}, i32, i64)"
            size = f"i64 {8 * self.count}"
            lines.append(f"%c = call {_POINTER} @memset({_POINTER} %out, i32 0, {size})")
        here: dict[Node, str] = {}
        for k, places in outputs.items():
            value = self._value(lines, here, k)
            for place in places:
                _store(lines, value, "out", place, f"%o{place}")
        arrays = ", ".join(f"{_POINTER} %{name}" for name in (*_ARRAYS, "out"))
        lines += [f"call void @piece{i}({arrays}, {memory})" for i in range(len(self.pieces))]
        if self.memory:
            lines.append(f"call void @free({_POINTER} %m)")
        return "\n".join([*lines, "ret void", "}"])


def _store(lines: list[str], value: str, array: str, place: int, name: str) -> None:
    lines.append(f"{name} = getelementptr double, {_POINTER} %{array}, i64 {place}")
    lines.append(f"store double {value}, {_POINTER} {name}")


def _hex(value: float) -> str:
    """A double as text, every bit of it."""
    value = math.nan if math.isnan(value) else value
    return f"0x{struct.unpack('>Q', struct.pack('>d', value))[0]:016x}"
