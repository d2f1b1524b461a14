"""Arrays: their entries, the views that indices and slices give, and new ones.

Indices are not checked. A constant one below zero counts from the end, others must not be below
zero; slices have bounds within the array, and no step. New arrays last until the function returns.
"""

from __future__ import annotations

from collections.abc import Callable

from phasekit.numerics.compiler.code import Code, constant
from phasekit.numerics.compiler.kinds import (
    BOOL,
    COMPLEX,
    ELEMENTS,
    FLOAT,
    INT,
    UNKNOWN,
    Array,
    CompileError,
    Element,
    Value,
    described,
)

#: A slice: its bounds, None where they are those of the axis.
Slice = tuple[Value | None, Value | None]


def lengths(array: Value) -> list[Value]:
    """The lengths along all axes."""
    assert isinstance(array.kind, Array)
    return [_length(part) for part in array.parts[1 : 1 + array.kind.ndim]]


def _length(part: str) -> Value:
    return constant(int(part)) if not part.startswith("%") else Value(INT, (part,))


def size(code: Code, array: Value) -> Value:
    """The number of entries."""
    first, *rest = lengths(array) or [constant(1)]
    for other in rest:
        first = Value(INT, (code.op(f"mul i64 {first.parts[0]}, {other.parts[0]}"),))
    return first


def view(code: Code, array: Value, indices: list[Value | Slice]) -> tuple[Value, str]:
    """What indices and slices leave of an array, and where it begins; without axes one entry."""
    kind = array.kind
    assert isinstance(kind, Array)
    if len(indices) > kind.ndim:
        raise CompileError(f"{len(indices)} indices of an array with {kind.ndim} axes")
    all_: list[Value | Slice] = [*indices, *[(None, None)] * (kind.ndim - len(indices))]
    dims = array.parts[1 : 1 + kind.ndim]
    left: list[tuple[int, str]] = []
    starts: list[str] = []
    for axis, index in enumerate(all_):
        if isinstance(index, Value):
            starts.append(_index(code, index, dims[axis]))
        else:
            start, length = _bounds(code, index, dims[axis])
            starts.append(start)
            left.append((axis, length))
    address = _address(code, array, starts)
    # What is left lies in one piece where only the first axis that is left may be cut.
    first = min((axis for axis, _ in left), default=kind.ndim)
    whole = kind.whole and [axis for axis, _ in left] == list(range(first, kind.ndim))
    whole = whole and all(all_[axis] == (None, None) for axis in range(first + 1, kind.ndim))
    parts = [address, *(length for _, length in left)]
    if not whole:
        strides = code.strides(array)
        parts += [strides[axis] for axis, _ in left]
    return Value(Array(kind.code, len(left), whole), tuple(parts)), address


def _index(code: Code, index: Value, length: str) -> str:
    if index.kind not in (INT, BOOL):
        raise CompileError(f"an index is {described(index.kind)}")
    (part,) = code.cast(index, INT).parts
    if index.constant is not UNKNOWN and index.constant < 0:
        part = code.op(f"add i64 {length}, {part}")
    if code.program.checked:
        code.program.check(code, part, length)
    return part


def _bounds(code: Code, bounds: Slice, length: str) -> tuple[str, str]:
    start, stop = bounds
    if start is None and stop is None:
        return "0", length
    first = "0" if start is None else code.cast(start, INT).parts[0]
    last = length if stop is None else code.cast(stop, INT).parts[0]
    for value, part in ((start, first), (stop, last)):
        if value is not None and value.constant is not UNKNOWN and value.constant < 0:
            raise CompileError(f"a slice has the bound {part}, below zero")
    if code.program.checked and length != "0":
        for part in (first, last):
            code.program.check(code, part, code.op(f"add i64 {length}, 1"))
    return first, last if first == "0" else code.op(f"sub i64 {last}, {first}")


def _address(code: Code, array: Value, starts: list[str]) -> str:
    kind = array.kind
    assert isinstance(kind, Array)
    data, stored = array.parts[0], kind.element.stored
    if not kind.whole:
        for start, stride in zip(starts, array.parts[1 + kind.ndim :], strict=True):
            if start != "0":
                offset = code.op(f"mul i64 {start}, {stride}")
                data = code.op(f"getelementptr inbounds i8, ptr {data}, i64 {offset}")
        return data
    place = "0"
    for axis, start in enumerate(starts):
        if place != "0":
            place = code.op(f"mul i64 {place}, {array.parts[1 + axis]}")
        if place == "0":
            place = start
        elif start != "0":
            place = code.op(f"add i64 {place}, {start}")
    if place == "0":
        return data
    return code.op(f"getelementptr inbounds {stored}, ptr {data}, i64 {place}")


def load(code: Code, element: Element, address: str) -> Value:
    """An entry."""
    if element.kind == COMPLEX:
        other = code.op(f"getelementptr inbounds double, ptr {address}, i64 1")
        return Value(COMPLEX, tuple(code.op(f"load double, ptr {a}") for a in (address, other)))
    part = code.op(f"load {element.stored}, ptr {address}")
    if element.kind == BOOL:
        part = code.op(f"icmp ne i8 {part}, 0")
    elif element.code == "f4":
        part = code.op(f"fpext float {part} to double")
    elif element.stored != "i64" and element.kind == INT:
        part = code.op(
            f"{'z' if element.code[0] == 'u' else 's'}ext {element.stored} {part} to i64"
        )
    return Value(element.kind, (part,))


def store(code: Code, element: Element, address: str, value: Value) -> None:
    """Write an entry."""
    if element.kind == BOOL and value.kind != BOOL or element.kind == INT and value.kind == FLOAT:
        raise CompileError(f"{described(value.kind)} is written into an array of {element.code}")
    value = code.cast(value, element.kind)
    if element.kind == COMPLEX:
        other = code.op(f"getelementptr inbounds double, ptr {address}, i64 1")
        for part, at in zip(value.parts, (address, other), strict=True):
            code.do(f"store double {part}, ptr {at}")
        return
    (part,) = value.parts
    if element.kind == BOOL:
        part = code.op(f"zext i1 {part} to i8")
    elif element.code == "f4":
        part = code.op(f"fptrunc double {part} to float")
    elif element.kind == INT and element.stored != "i64":
        part = code.op(f"trunc i64 {part} to {element.stored}")
    code.do(f"store {element.stored} {part}, ptr {address}")


def new(code: Code, element: Element, shape: list[Value], *, cleared: bool) -> Value:
    """A new array."""
    dims = tuple(code.cast(length, INT).parts[0] for length in shape)
    bytes_ = str(element.size)
    for length in dims:
        bytes_ = code.op(f"mul i64 {bytes_}, {length}")
    code.allocates = True
    name = code.program.allocator(cleared=cleared)
    data = code.op(f"call noalias ptr @{name}(ptr %arena, i64 {bytes_})")
    return Value(Array(element.code, len(dims)), (data, *dims))


def fill(code: Code, array: Value, value: Value) -> None:
    """Write one value, or the entries of an array of as many axes, into all entries of an array."""
    kind = array.kind
    assert isinstance(kind, Array)
    copied = isinstance(value.kind, Array)
    if isinstance(value.kind, Array) and value.kind.ndim != kind.ndim:
        raise CompileError("arrays are copied only into arrays with as many axes")

    def run(indices: list[Value]) -> None:
        if len(indices) < kind.ndim:
            loop(code, array.parts[1 + len(indices)], lambda i: run([*indices, i]))
            return
        entry = value
        if copied:
            assert isinstance(value.kind, Array)
            entry = load(code, value.kind.element, view(code, value, [*indices])[1])
        store(code, kind.element, view(code, array, [*indices])[1], entry)

    run([])


def loop(code: Code, count: str, body: Callable[[Value], None]) -> None:
    """Run through 0, 1, ... below a count."""
    counter = code.slot("i64")
    head, inside, after = (code.fresh("b") for _ in range(3))
    code.do(f"store i64 0, ptr {counter}")
    code.block(head)
    i = code.op(f"load i64, ptr {counter}")
    code.branch(code.op(f"icmp slt i64 {i}, {count}"), inside, after)
    code.block(inside)
    body(Value(INT, (i,)))
    code.do(f"store i64 {code.op(f'add nuw nsw i64 {i}, 1')}, ptr {counter}")
    code.jump(head)
    code.block(after)


def copied(code: Code, array: Value) -> Value:
    """A new array with the same entries."""
    kind = array.kind
    assert isinstance(kind, Array)
    result = new(code, kind.element, lengths(array), cleared=False)
    fill(code, result, array)
    return result


def from_values(code: Code, values: list[Value]) -> Value:
    """A new array of these numbers."""
    kind = values[0].kind
    for value in values[1:]:
        kind = kind if value.kind == kind else FLOAT
    element = next(e for e in ELEMENTS.values() if e.kind == kind)
    result = new(code, element, [constant(len(values))], cleared=False)
    for i, value in enumerate(values):
        store(code, element, view(code, result, [constant(i)])[1], value)
    return result
