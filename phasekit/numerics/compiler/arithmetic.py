"""Operations on numbers and truths, as Python's interpreter does them on doubles of NumPy.

Division by zero gives infinity or NaN. Nothing is rearranged: each result is rounded as written.
"""

from __future__ import annotations

import ast
import operator
from collections.abc import Callable
from typing import Any

from phasekit.numerics.compiler.code import Code, constant
from phasekit.numerics.compiler.kinds import (
    BOOL,
    COMPLEX,
    FLOAT,
    INT,
    NONE,
    UNKNOWN,
    CompileError,
    Kind,
    Scalar,
    Value,
    described,
    joined,
    number,
)

_FOLDED: dict[type, Callable[..., Any]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.FloorDiv: operator.floordiv,
    ast.Mod: operator.mod,
    ast.Pow: operator.pow,
    ast.LShift: operator.lshift,
    ast.RShift: operator.rshift,
    ast.BitAnd: operator.and_,
    ast.BitOr: operator.or_,
    ast.BitXor: operator.xor,
    ast.Eq: operator.eq,
    ast.NotEq: operator.ne,
    ast.Lt: operator.lt,
    ast.LtE: operator.le,
    ast.Gt: operator.gt,
    ast.GtE: operator.ge,
}
_REAL: dict[type, str] = {ast.Add: "fadd", ast.Sub: "fsub", ast.Mult: "fmul", ast.Div: "fdiv"}
_WHOLE: dict[type, str] = {ast.Add: "add", ast.Sub: "sub", ast.Mult: "mul"}
_BITS: dict[type, str] = {
    ast.LShift: "shl",
    ast.RShift: "ashr",
    ast.BitAnd: "and",
    ast.BitOr: "or",
    ast.BitXor: "xor",
}
_COMPARED: dict[type, tuple[str, str]] = {
    ast.Eq: ("oeq", "eq"),
    ast.NotEq: ("une", "ne"),
    ast.Lt: ("olt", "slt"),
    ast.LtE: ("ole", "sle"),
    ast.Gt: ("ogt", "sgt"),
    ast.GtE: ("oge", "sge"),
}
#: Powers up to which whole exponents are products, as of the square alone.
_SQUARE = 2


def folded(operation: type, *values: Value) -> Value | None:
    """The result that the compiler knows, if it knows all that it takes."""
    if any(value.constant is UNKNOWN or not isinstance(value.kind, Scalar) for value in values):
        return None
    try:
        result = _FOLDED[operation](*(value.constant for value in values))
    except (ArithmeticError, TypeError, ValueError):
        return None  # what the machine makes of it
    return constant(result) if isinstance(result, (bool, int, float, complex)) else None


def binary(code: Code, operation: type, left: Value, right: Value) -> Value:
    """Combine two numbers."""
    known = folded(operation, left, right)
    if known is not None:
        return known
    if operation is ast.Pow:
        return _power(code, left, right)
    kind = common(left, right)
    if operation in _BITS:
        wanted = INT if operation in (ast.LShift, ast.RShift) or kind != BOOL else BOOL
        if kind not in (INT, BOOL):
            raise CompileError(f"bits of {described(kind)} are not supported")
        x, y = (code.cast(value, wanted).parts[0] for value in (left, right))
        return Value(wanted, (code.op(f"{_BITS[operation]} {wanted.types[0]} {x}, {y}"),))
    if kind == BOOL:
        kind = INT
    if operation is ast.Div and kind == INT:
        kind = FLOAT
    left, right = code.cast(left, kind), code.cast(right, kind)
    if kind == COMPLEX:
        return _complex(code, operation, left, right)
    x, y = left.parts[0], right.parts[0]
    if operation in (ast.FloorDiv, ast.Mod):
        return (_floored_whole if kind == INT else _floored_real)(code, operation, x, y)
    names = _WHOLE if kind == INT else _REAL
    return Value(kind, (code.op(f"{names[operation]} {kind.types[0]} {x}, {y}"),))


def common(left: Value, right: Value) -> Scalar:
    """The kind of numbers that holds both."""
    kind = joined(left.kind, right.kind) if left.kind != right.kind else left.kind
    if kind not in (BOOL, INT, FLOAT, COMPLEX):
        raise CompileError(f"arithmetic on {described(kind)} is not supported; write a loop")
    assert isinstance(kind, Scalar)
    return kind


def _power(code: Code, left: Value, right: Value) -> Value:
    if right.constant == _SQUARE and left.kind in (INT, FLOAT):
        return binary(code, ast.Mult, left, left)
    if common(left, right) != FLOAT or left.kind != FLOAT:
        raise CompileError("a power of a whole number is not supported; write the product")
    x, y = left.parts[0], code.cast(right, FLOAT).parts[0]
    return Value(FLOAT, (code.program.library(code, "pow", x, y),))


def _floored_whole(code: Code, operation: type, x: str, y: str) -> Value:
    """Quotient or rest of Python, whose quotients are rounded down."""
    rest = code.op(f"srem i64 {x}, {y}")
    other = code.op(f"xor i64 {rest}, {y}")
    apart = code.op(f"icmp slt i64 {other}, 0")
    nonzero = code.op(f"icmp ne i64 {rest}, 0")
    off = code.op(f"and i1 {apart}, {nonzero}")
    if operation is ast.Mod:
        moved = code.op(f"add i64 {rest}, {y}")
        return Value(INT, (code.op(f"select i1 {off}, i64 {moved}, i64 {rest}"),))
    quotient, less = code.op(f"sdiv i64 {x}, {y}"), code.op(f"sext i1 {off} to i64")
    return Value(INT, (code.op(f"add i64 {quotient}, {less}"),))


def _floored_real(code: Code, operation: type, x: str, y: str) -> Value:
    if operation is ast.FloorDiv:
        raise CompileError("a floored quotient of floats is not supported; write math.floor")
    rest = code.op(f"frem double {x}, {y}")
    zero = number(0.0)
    below = [code.op(f"fcmp olt double {value}, {zero}") for value in (rest, y)]
    apart = code.op(f"xor i1 {below[0]}, {below[1]}")
    none = code.op(f"fcmp oeq double {rest}, {zero}")
    moved = code.op(f"fadd double {rest}, {y}")
    signed = code.program.intrinsic(code, "copysign", zero, y)
    found = code.op(f"select i1 {apart}, double {moved}, double {rest}")
    return Value(FLOAT, (code.op(f"select i1 {none}, double {signed}, double {found}"),))


def _complex(code: Code, operation: type, left: Value, right: Value) -> Value:
    (a, b), (c, d) = left.parts, right.parts

    def real(name: str, x: str, y: str) -> str:
        return code.op(f"f{name} double {x}, {y}")

    if operation in (ast.Add, ast.Sub):
        name = _REAL[operation][1:]
        return Value(COMPLEX, (real(name, a, c), real(name, b, d)))
    if operation is ast.Mult:
        first = real("sub", real("mul", a, c), real("mul", b, d))
        return Value(COMPLEX, (first, real("add", real("mul", a, d), real("mul", b, c))))
    if operation is not ast.Div:
        raise CompileError("complex numbers have +, -, *, / alone; write others out")
    # Python's way: by the larger part of the divisor.
    size = [code.program.intrinsic(code, "fabs", value) for value in (c, d)]
    first = code.op(f"fcmp oge double {size[0]}, {size[1]}")
    large = code.op(f"select i1 {first}, double {c}, double {d}")
    small = code.op(f"select i1 {first}, double {d}, double {c}")
    ratio = real("div", small, large)
    below = real("add", large, real("mul", small, ratio))
    along = code.op(f"select i1 {first}, double {a}, double {b}")
    across = code.op(f"select i1 {first}, double {b}, double {a}")
    top = real("add", along, real("mul", across, ratio))
    turned = real("mul", along, ratio)
    ahead = real("sub", across, turned)
    back = real("sub", turned, across)
    other = code.op(f"select i1 {first}, double {ahead}, double {back}")
    return Value(COMPLEX, (real("div", top, below), real("div", other, below)))


def compared(code: Code, operation: type, left: Value, right: Value) -> Value:
    """Whether a comparison holds."""
    if operation in (ast.Is, ast.IsNot):
        if right.kind != NONE and left.kind != NONE:
            raise CompileError("`is` compares with None alone")
        return constant((left.kind == right.kind) == (operation is ast.Is))
    known = folded(operation, left, right)
    if known is not None:
        return known
    kind = common(left, right)
    kind = INT if kind == BOOL else kind
    real, whole = _COMPARED[operation]
    left, right = code.cast(left, kind), code.cast(right, kind)
    if kind == COMPLEX:
        if operation not in (ast.Eq, ast.NotEq):
            raise CompileError("complex numbers have no order")
        both = [
            code.op(f"fcmp {real} double {x}, {y}")
            for x, y in zip(left.parts, right.parts, strict=True)
        ]
        joint = "and" if operation is ast.Eq else "or"
        return Value(BOOL, (code.op(f"{joint} i1 {both[0]}, {both[1]}"),))
    name = f"icmp {whole} i64" if kind == INT else f"fcmp {real} double"
    return Value(BOOL, (code.op(f"{name} {left.parts[0]}, {right.parts[0]}"),))


def truth(code: Code, value: Value) -> Value:
    """Whether a value is not zero."""
    if value.kind == BOOL:
        return value
    if value.kind == NONE:
        return constant(False)
    if value.constant is not UNKNOWN:
        return constant(bool(value.constant))
    if value.kind == INT:
        return Value(BOOL, (code.op(f"icmp ne i64 {value.parts[0]}, 0"),))
    if value.kind == FLOAT:
        return Value(BOOL, (code.op(f"fcmp une double {value.parts[0]}, {number(0.0)}"),))
    raise CompileError(f"the truth of {described(value.kind)} is not supported")


def negative(code: Code, value: Value) -> Value:
    """The value with the other sign."""
    if value.constant is not UNKNOWN and value.kind in (INT, FLOAT, COMPLEX):
        return constant(-value.constant)
    if value.kind in (FLOAT, COMPLEX):
        return Value(value.kind, tuple(code.op(f"fneg double {part}") for part in value.parts))
    (part,) = code.cast(value, INT).parts
    return Value(INT, (code.op(f"sub i64 0, {part}"),))


def inverted(code: Code, value: Value) -> Value:
    """Not."""
    value = truth(code, value)
    if value.constant is not UNKNOWN:
        return constant(not value.constant)
    return Value(BOOL, (code.op(f"xor i1 {value.parts[0]}, true"),))


def chosen(code: Code, condition: Value, yes: Value, no: Value, kind: Kind) -> Value:
    """One of two values that are both there."""
    yes, no = code.cast(yes, kind), code.cast(no, kind)
    (test,) = condition.parts
    parts = tuple(
        code.op(f"select i1 {test}, {one} {x}, {one} {y}")
        for one, x, y in zip(kind.types, yes.parts, no.parts, strict=True)
    )
    return Value(kind, parts)
