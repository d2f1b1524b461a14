"""The text of one function in LLVM's language, as it is written."""

from __future__ import annotations

from typing import Any

from phasekit.numerics.compiler.kinds import (
    BOOL,
    COMPLEX,
    FLOAT,
    INT,
    NONE,
    UNKNOWN,
    Array,
    CompileError,
    Kind,
    Scalar,
    Tuple,
    Value,
    described,
    joined,
    number,
    split,
    tuple_of,
)
from phasekit.numerics.compiler.module import Module
from phasekit.numerics.compiler.source import Definition


class Widened(Exception):
    """A variable turned out to be of a wider kind than it seemed: the function is written anew."""


class Code:
    """Writes the instructions of a function; its variables lie in memory until LLVM lifts them."""

    def __init__(self, program: Module, source: Definition, declared: dict[str, Kind]) -> None:
        self.program, self.source, self.declared = program, source, declared
        self.lines: list[str] = []
        self.slots: list[str] = []
        self.variables: dict[str, tuple[Kind, tuple[str, ...]]] = {}
        self.loops: list[tuple[str, str]] = []
        self.count = 0
        self.open = True  # whether instructions may follow in this block
        self.allocates = False

    def fresh(self, prefix: str = "t") -> str:
        """A name that is not taken."""
        self.count += 1
        return f"{prefix}{self.count}"

    def do(self, text: str) -> None:
        """Write an instruction without a result."""
        if self.open:
            self.lines.append(f"  {text}")

    def op(self, text: str) -> str:
        """Write an instruction; the register that holds its result."""
        register = f"%{self.fresh()}"
        self.do(f"{register} = {text}")
        return register

    def block(self, label: str) -> None:
        """Begin a block, into which the one before runs on."""
        self.jump(label)
        self.lines.append(f"{label}:")
        self.open = True

    def jump(self, label: str) -> None:
        """End a block."""
        self.do(f"br label %{label}")
        self.open = False

    def branch(self, condition: str, yes: str, no: str) -> None:
        """End a block, to go on in one of two."""
        self.do(f"br i1 {condition}, label %{yes}, label %{no}")
        self.open = False

    def cut(self) -> int:
        """End a block whose last instructions are written later, by `splice`."""
        self.open = False
        return len(self.lines)

    def splice(self, at: int, slots: tuple[str, ...], value: Value, kind: Kind, after: str) -> None:
        """Let a block that was cut store a value, and go on after."""
        later, was = self.lines[at:], self.open
        del self.lines[at:]
        self.open = True
        self.keep(slots, self.cast(value, kind))
        self.jump(after)
        self.lines += later
        self.open = was

    def slot(self, kind: str) -> str:
        """Memory for a value, all through the function."""
        register = f"%{self.fresh('s')}"
        self.slots.append(f"  {register} = alloca {kind}")
        return register

    def slots_of(self, kind: Kind) -> tuple[str, ...]:
        """Memory for all parts of a value."""
        return tuple(map(self.slot, kind.types))

    def keep(self, slots: tuple[str, ...], value: Value) -> None:
        """Store a value."""
        for slot, part, kind in zip(slots, value.parts, value.kind.types, strict=True):
            self.do(f"store {kind} {part}, ptr {slot}")

    def loaded(self, kind: Kind, slots: tuple[str, ...]) -> Value:
        """Load a value."""
        types = zip(kind.types, slots, strict=True)
        parts = tuple(self.op(f"load {one}, ptr {slot}") for one, slot in types)
        return Value(kind, parts, None if kind == NONE else UNKNOWN)

    def assign(self, name: str, value: Value) -> None:
        """Give a variable a value."""
        if name not in self.variables:
            kind = self.declared.setdefault(name, value.kind)
            self.variables[name] = kind, self.slots_of(kind)
        kind, slots = self.variables[name]
        wide = self.joined(name, kind, value.kind)
        if wide != kind:
            self.declared[name] = wide
            raise Widened
        self.keep(slots, self.cast(value, kind))

    def joined(self, name: str, one: Kind, other: Kind) -> Kind:
        """The kind that holds both that a variable is."""
        try:
            return joined(one, other)
        except CompileError as error:
            raise CompileError(f"{name}: {error}") from None

    def cast(self, value: Value, kind: Kind) -> Value:
        """The same value as one of a wider kind."""
        if value.kind == kind:
            return value
        if isinstance(kind, Tuple) and isinstance(value.kind, Tuple):
            values = split(value.kind, value.parts)
            pairs = zip(values, kind.kinds, strict=True)
            return tuple_of([self.cast(one, own) for one, own in pairs], kind.names)
        if isinstance(kind, Array) and isinstance(value.kind, Array):
            return Value(kind, (*value.parts, *self.strides(value)))
        if value.constant is not UNKNOWN and kind in (INT, FLOAT, COMPLEX):
            return constant({INT: int, FLOAT: float, COMPLEX: complex}[kind](value.constant))
        (part, *_) = value.parts or ("",)
        if (value.kind, kind) == (BOOL, INT):
            return Value(INT, (self.op(f"zext i1 {part} to i64"),))
        if (value.kind, kind) == (BOOL, FLOAT):
            return Value(FLOAT, (self.op(f"uitofp i1 {part} to double"),))
        if (value.kind, kind) == (INT, FLOAT):
            return Value(FLOAT, (self.op(f"sitofp i64 {part} to double"),))
        if kind == COMPLEX:
            return Value(COMPLEX, (*self.cast(value, FLOAT).parts, number(0.0)))
        raise CompileError(f"got {described(value.kind)} where {described(kind)} is wanted")

    def strides(self, array: Value) -> tuple[str, ...]:
        """Distances in bytes between neighbours along each axis."""
        kind = array.kind
        assert isinstance(kind, Array)
        if not kind.whole:
            return array.parts[1 + kind.ndim :]
        found = [str(kind.element.size)]
        for length in array.parts[:1:-1]:
            found.append(self.op(f"mul i64 {found[-1]}, {length}"))
        return tuple(reversed(found)) if kind.ndim else ()


def constant(value: Any) -> Value:
    """A value that is known."""
    if value is None:
        return Value(NONE, (), None)
    if isinstance(value, bool):
        return Value(BOOL, ("true" if value else "false",), value)
    if isinstance(value, int):
        return Value(INT, (str(int(value)),), int(value))
    if isinstance(value, float):
        return Value(FLOAT, (number(value),), float(value))
    if isinstance(value, complex):
        return Value(COMPLEX, (number(value.real), number(value.imag)), complex(value))
    if isinstance(value, tuple):
        return tuple_of([constant(one) for one in value])
    return Value(Scalar("object", ()), (), value)
