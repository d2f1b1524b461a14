"""Functions of Python, `math` and NumPy that kernels may call.

Roots, signs and roundings are instructions of the processor; others come from the C library, as
those of `math` do, so that interpreted and compiled code give the same bits.
"""

from __future__ import annotations

import ast
import builtins
import cmath
import math
from collections.abc import Callable
from typing import Any

import numpy as np

from phasekit.numerics.compiler import arithmetic, arrays
from phasekit.numerics.compiler.code import Code, constant
from phasekit.numerics.compiler.kinds import (
    BOOL,
    COMPLEX,
    DOUBLES,
    ELEMENTS,
    FLOAT,
    INT,
    LONGS,
    NOTHING,
    OBJECT,
    UNKNOWN,
    Array,
    CompileError,
    Element,
    Tuple,
    Value,
    described,
    element_of,
    number,
    split,
)
from phasekit.numerics.pointers import carray, invoke, lapack_gesv

Translation = Callable[..., Value]

#: Functions of doubles that come from the C library.
_LIBRARY: dict[Any, str] = {
    math.sin: "sin",
    math.cos: "cos",
    math.tan: "tan",
    math.asin: "asin",
    math.acos: "acos",
    math.atan: "atan",
    math.atan2: "atan2",
    math.sinh: "sinh",
    math.cosh: "cosh",
    math.tanh: "tanh",
    math.asinh: "asinh",
    math.acosh: "acosh",
    math.atanh: "atanh",
    math.exp: "exp",
    math.expm1: "expm1",
    math.log: "log",
    math.log1p: "log1p",
    math.log2: "log2",
    math.pow: "pow",
    math.erf: "erf",
    math.erfc: "erfc",
    np.sin: "sin",
    np.cos: "cos",
    np.arctan2: "atan2",
    np.arccos: "acos",
    np.exp: "exp",
    np.log: "log",
    np.log2: "log2",
}
#: Functions of doubles that are instructions.
_INSTRUCTIONS: dict[Any, str] = {
    math.sqrt: "sqrt",
    np.sqrt: "sqrt",
    math.fabs: "fabs",
    np.abs: "fabs",
    math.copysign: "copysign",
    np.copysign: "copysign",
    np.rint: "rint",
    np.round: "rint",
    np.floor: "floor",
    np.ceil: "ceil",
    np.trunc: "trunc",
}
_ROUNDED: dict[Any, str] = {math.floor: "floor", math.ceil: "ceil", math.trunc: "trunc"}


def call(code: Code, function: Any, args: list[Value]) -> Value:
    """What a known function gives."""
    if function in _LIBRARY:
        known = _folded(function, args)
        if known is not None:
            return known
        parts = _reals(code, args)
        return Value(FLOAT, (code.program.library(code, _LIBRARY[function], *parts),))
    if function in _INSTRUCTIONS:
        known = _folded(function, args)
        if known is not None:
            return known
        return Value(
            FLOAT, (code.program.intrinsic(code, _INSTRUCTIONS[function], *_reals(code, args)),)
        )
    if function in _ROUNDED:
        part = code.program.intrinsic(code, _ROUNDED[function], *_reals(code, args))
        return Value(INT, (code.op(f"fptosi double {part} to i64"),))
    if function in _KNOWN:
        try:
            return _KNOWN[function](code, *args)
        except TypeError as error:
            raise CompileError(f"{_name(function)}: {error}") from None
    raise CompileError(
        f"the function {_name(function)} is not known; wants one of this package marked by "
        "`inline` or `routine`, or one of math or NumPy on numbers"
    )


def _name(function: Any) -> str:
    return str(getattr(function, "__qualname__", getattr(function, "__name__", function)))


def _folded(function: Any, args: list[Value]) -> Value | None:
    if any(value.constant is UNKNOWN or value.kind == COMPLEX for value in args):
        return None
    try:
        return constant(float(function(*(value.constant for value in args))))
    except (ArithmeticError, ValueError):
        return None


def _reals(code: Code, args: list[Value]) -> list[str]:
    if any(value.kind not in (BOOL, INT, FLOAT) for value in args):
        kinds = ", ".join(described(value.kind) for value in args)
        raise CompileError(f"a function of real numbers got {kinds}")
    return [code.cast(value, FLOAT).parts[0] for value in args]


def _abs(code: Code, x: Value) -> Value:
    if x.kind == COMPLEX:
        return Value(FLOAT, (code.program.library(code, "hypot", *x.parts),))
    if x.kind == FLOAT:
        known = _folded(abs, [x])
        return known or Value(FLOAT, (code.program.intrinsic(code, "fabs", *x.parts),))
    (part,) = code.cast(x, INT).parts
    if x.constant is not UNKNOWN:
        return constant(abs(int(x.constant)))
    below, turned = code.op(f"icmp slt i64 {part}, 0"), code.op(f"sub i64 0, {part}")
    return Value(INT, (code.op(f"select i1 {below}, i64 {turned}, i64 {part}"),))


def _extreme(name: str) -> Translation:
    def translate(code: Code, *args: Value) -> Value:
        if len(args) == 1 and isinstance(args[0].kind, Tuple):
            args = tuple(split(args[0].kind, args[0].parts))
        found, *others = args
        for other in others:
            kind = arithmetic.common(found, other)
            kind = INT if kind == BOOL else kind
            better = arithmetic.compared(code, ast.Gt if name == "max" else ast.Lt, other, found)
            if better.constant is not UNKNOWN:
                found = code.cast(other if better.constant else found, kind)
            else:
                found = arithmetic.chosen(code, better, other, found, kind)
        return found

    return translate


def _int(code: Code, x: Value) -> Value:
    if x.constant is not UNKNOWN and x.kind in (BOOL, INT, FLOAT):
        return constant(int(x.constant))
    if x.kind == FLOAT:
        return Value(INT, (code.op(f"fptosi double {x.parts[0]} to i64"),))
    return code.cast(x, INT)


def _float(code: Code, x: Value) -> Value:
    return code.cast(x, FLOAT)


def _bool(code: Code, x: Value) -> Value:
    return arithmetic.truth(code, x)


def _complex(code: Code, real: Value, imag: Value | None = None) -> Value:
    if imag is None:
        return code.cast(real, COMPLEX)
    return Value(COMPLEX, (*code.cast(real, FLOAT).parts, *code.cast(imag, FLOAT).parts))


def _isnan(code: Code, x: Value) -> Value:
    (part,) = _reals(code, [x])
    return Value(BOOL, (code.op(f"fcmp uno double {part}, {part}"),))


def _isinf(code: Code, x: Value) -> Value:
    size = code.program.intrinsic(code, "fabs", *_reals(code, [x]))
    return Value(BOOL, (code.op(f"fcmp oeq double {size}, {number(math.inf)}"),))


def _isfinite(code: Code, x: Value) -> Value:
    if x.kind in (BOOL, INT):
        return constant(True)
    if x.kind == COMPLEX:
        both = [_isfinite(code, Value(FLOAT, (part,))).parts[0] for part in x.parts]
        return Value(BOOL, (code.op(f"and i1 {both[0]}, {both[1]}"),))
    size = code.program.intrinsic(code, "fabs", *_reals(code, [x]))
    return Value(BOOL, (code.op(f"fcmp olt double {size}, {number(math.inf)}"),))


def _sign(code: Code, x: Value) -> Value:
    (part,) = _reals(code, [x])
    zero, one, minus = number(0.0), number(1.0), number(-1.0)
    above = code.op(f"fcmp ogt double {part}, {zero}")
    below = code.op(f"fcmp olt double {part}, {zero}")
    nan = code.op(f"fcmp uno double {part}, {part}")
    found = code.op(f"select i1 {above}, double {one}, double {zero}")
    found = code.op(f"select i1 {below}, double {minus}, double {found}")
    return Value(FLOAT, (code.op(f"select i1 {nan}, double {part}, double {found}"),))


def _len(code: Code, x: Value) -> Value:
    if isinstance(x.kind, Tuple):
        return constant(len(x.kind.kinds))
    if isinstance(x.kind, Array):
        return arrays.lengths(x)[0]
    raise CompileError(f"the length of {described(x.kind)}")


def _shape_of(shape: Value) -> list[Value]:
    if not isinstance(shape.kind, Tuple):
        return [shape]
    if shape.constant is not UNKNOWN:
        return [constant(one) for one in shape.constant]
    return split(shape.kind, shape.parts)


def _dtype(dtype: Value | None) -> Element:
    if dtype is None:
        return ELEMENTS["f8"]
    if dtype.kind != OBJECT:
        raise CompileError("the type of a new array is a type of NumPy's")
    return element_of(dtype.constant)


def _zeros(code: Code, shape: Value, dtype: Value | None = None) -> Value:
    return arrays.new(code, _dtype(dtype), _shape_of(shape), cleared=True)


def _empty(code: Code, shape: Value, dtype: Value | None = None) -> Value:
    return arrays.new(code, _dtype(dtype), _shape_of(shape), cleared=False)


def _full(code: Code, shape: Value, value: Value) -> Value:
    if value.kind not in (FLOAT, INT, BOOL):
        raise CompileError(f"np.full of {described(value.kind)}")
    code_ = {FLOAT: "f8", INT: "i8", BOOL: "b1"}[value.kind]
    result = arrays.new(code, ELEMENTS[code_], _shape_of(shape), cleared=False)
    arrays.fill(code, result, value)
    return result


def _ones(code: Code, shape: Value) -> Value:
    return _full(code, shape, constant(1.0))


def _empty_like(code: Code, array: Value) -> Value:
    assert isinstance(array.kind, Array)
    return arrays.new(code, array.kind.element, arrays.lengths(array), cleared=False)


def _array(code: Code, values: Value) -> Value:
    if not isinstance(values.kind, Tuple):
        raise CompileError("np.array wants numbers that are written out")
    return arrays.from_values(code, split(values.kind, values.parts))


def _cexp(code: Code, z: Value) -> Value:
    x, y = code.cast(z, COMPLEX).parts
    size = code.program.library(code, "exp", x)
    return _polar(code, size, size, y)


def _polar(code: Code, along: str, across: str, y: str) -> Value:
    cosine, sine = (code.program.library(code, name, y) for name in ("cos", "sin"))
    return Value(
        COMPLEX,
        (code.op(f"fmul double {along}, {cosine}"), code.op(f"fmul double {across}, {sine}")),
    )


def _ccosh(code: Code, z: Value) -> Value:
    x, y = code.cast(z, COMPLEX).parts
    cosh, sinh = (code.program.library(code, name, x) for name in ("cosh", "sinh"))
    return _polar(code, cosh, sinh, y)


def _csinh(code: Code, z: Value) -> Value:
    x, y = code.cast(z, COMPLEX).parts
    cosh, sinh = (code.program.library(code, name, x) for name in ("cosh", "sinh"))
    return _polar(code, sinh, cosh, y)


def _ccos(code: Code, z: Value) -> Value:  # cosh(i z)
    x, y = code.cast(z, COMPLEX).parts
    return _ccosh(code, Value(COMPLEX, (code.op(f"fneg double {y}"), x)))


def _csin(code: Code, z: Value) -> Value:  # -i sinh(i z)
    x, y = code.cast(z, COMPLEX).parts
    real, imag = _csinh(code, Value(COMPLEX, (code.op(f"fneg double {y}"), x))).parts
    return Value(COMPLEX, (imag, code.op(f"fneg double {real}")))


def _carray(code: Code, pointer: Value, shape: Value) -> Value:
    if pointer.kind not in (DOUBLES, LONGS):
        raise CompileError(f"carray got {described(pointer.kind)}, wants a pointer")
    dims = tuple(code.cast(length, INT).parts[0] for length in _shape_of(shape))
    stored = "f8" if pointer.kind == DOUBLES else "i8"
    return Value(Array(stored, len(dims)), (*pointer.parts, *dims))


def _invoke(code: Code, address: Value, *args: Value) -> Value:
    function = code.op(f"inttoptr i64 {code.cast(address, INT).parts[0]} to ptr")
    for value in args:
        if not isinstance(value.kind, Array) or not value.kind.whole:
            raise CompileError(f"invoke got {described(value.kind)}, wants arrays in one piece")
    code.do(f"call void {function}({', '.join(f'ptr {value.parts[0]}' for value in args)})")
    return NOTHING


def _gesv(code: Code, n: Value, many: Value, matrix: Value, swapped: Value, right: Value) -> Value:
    """LAPACK's dgesv, whose address is known when a process first calls it."""
    table = code.program.lapack()
    address = code.op(f"load ptr, ptr @{table}")
    numbers = [code.slot("i32") for _ in range(3)]
    for slot, value in zip(numbers, (n, many, constant(0)), strict=True):
        code.do(f"store i32 {code.op(f'trunc i64 {value.parts[0]} to i32')}, ptr {slot}")
    order, count, info = numbers
    code.do(
        f"call void {address}(ptr {order}, ptr {count}, ptr {matrix.parts[0]}, ptr {order}, "
        f"ptr {swapped.parts[0]}, ptr {right.parts[0]}, ptr {order}, ptr {info})"
    )
    failed = code.op(f"load i32, ptr {info}")
    return Value(INT, (code.op(f"sext i32 {failed} to i64"),))


_KNOWN: dict[Any, Translation] = {
    builtins.abs: _abs,
    builtins.min: _extreme("min"),
    builtins.max: _extreme("max"),
    builtins.int: _int,
    builtins.float: _float,
    builtins.bool: _bool,
    builtins.complex: _complex,
    builtins.len: _len,
    np.float64: _float,
    np.int64: _int,
    np.int8: _int,
    np.int16: _int,
    np.complex128: _complex,
    np.isnan: _isnan,
    math.isnan: _isnan,
    np.isinf: _isinf,
    math.isinf: _isinf,
    np.isfinite: _isfinite,
    math.isfinite: _isfinite,
    np.sign: _sign,
    np.zeros: _zeros,
    np.empty: _empty,
    np.full: _full,
    np.ones: _ones,
    np.empty_like: _empty_like,
    np.array: _array,
    cmath.exp: _cexp,
    cmath.sinh: _csinh,
    cmath.cosh: _ccosh,
    cmath.sin: _csin,
    cmath.cos: _ccos,
    carray: _carray,
    invoke: _invoke,
    lapack_gesv: _gesv,
}


def has_translation(function: Any) -> bool:
    """Whether a function is one of these."""
    try:
        return (
            function in _KNOWN
            or function in _LIBRARY
            or function in _INSTRUCTIONS
            or function in _ROUNDED
        )
    except TypeError:  # not hashable
        return False


def view(code: Code, value: Value, dtype: Value) -> Value:
    """The bits of a number as one of another type."""
    wanted = {np.int64: INT, np.float64: FLOAT}.get(dtype.constant)
    if value.kind not in (INT, FLOAT) or wanted is None:
        raise CompileError("`view` is one of float64 as int64, or the other way")
    (part,) = value.parts
    if wanted == value.kind:
        return value
    return Value(wanted, (code.op(f"bitcast {value.kind.types[0]} {part} to {wanted.types[0]}"),))
