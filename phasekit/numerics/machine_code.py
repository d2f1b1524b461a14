"""Expressions to machine code: a straight-line native function that fills an array.

A symbolic system needs no more of a compiler than this, and is ready in milliseconds.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import llvmlite.binding as llvm
from llvmlite import ir

from phasekit.errors import ParameterError
from phasekit.numerics.compiler.machine import finalized, processor, target
from phasekit.numerics.later import later

if TYPE_CHECKING:
    import sympy
else:
    sympy = later("sympy")

_DOUBLE = ir.DoubleType()

LONGEST_POWER = 64  # of those that are products
#: Functions of one argument that come from the C library.
LIBRARY = {
    "sin": "sin",
    "cos": "cos",
    "tan": "tan",
    "asin": "asin",
    "acos": "acos",
    "atan": "atan",
    "sinh": "sinh",
    "cosh": "cosh",
    "tanh": "tanh",
    "asinh": "asinh",
    "acosh": "acosh",
    "atanh": "atanh",
    "exp": "exp",
    "log": "log",
    "erf": "erf",
    "erfc": "erfc",
    "gamma": "tgamma",
    "loggamma": "lgamma",
}
#: Functions that have machine code, and those whose derivatives have it as well.
COMPILED = {*LIBRARY, "atan2", "Abs", "sign", "Heaviside", "Max", "Min", "Piecewise"}
DIFFERENTIABLE = COMPILED - {"gamma", "loggamma"}
#: What conditions compare by, by the names of their classes.
COMPARISONS = {
    "StrictLessThan": "<",
    "LessThan": "<=",
    "StrictGreaterThan": ">",
    "GreaterThan": ">=",
    "Equality": "==",
    "Unequality": "!=",
}


def compile_expressions(
    expressions: Sequence[sympy.Expr] | Mapping[int, sympy.Expr],
    inputs: Mapping[sympy.Symbol, tuple[int, int]],
    count: int | None = None,
    writer_class: type[Writer] | None = None,
) -> int:
    """Address of ``void (double *x, double *p, double *z, double *out)``.

    Expressions are those of the entries of ``out``, or by their places in it, of so many; other
    places become 0. Inputs tell of each symbol which array it is in, 0 for x, 1 for p, 2 for z, and
    its place. The writer is by default that of one double for each value.
    """
    pointer = _DOUBLE.as_pointer()
    module = new_module()
    function = ir.Function(module, ir.FunctionType(ir.VoidType(), [pointer] * 4), name="fill")
    builder = ir.IRBuilder(function.append_basic_block())
    kind = Writer if writer_class is None else writer_class
    writer = kind(module, builder, function.args, inputs)
    if not isinstance(expressions, Mapping):
        expressions = dict(enumerate(expressions))
    if count is not None and len(expressions) < count:
        writer.clear(function.args[3], count)
    shared, results = sympy.cse(
        list(expressions.values()), symbols=sympy.numbered_symbols("_c"), list=True
    )
    for symbol, expression in shared:
        truth = isinstance(expression, (sympy.Rel, sympy.And, sympy.Or, sympy.Not))
        writer.values[symbol] = (writer.condition if truth else writer.write)(expression)
    for i, result in zip(expressions, results, strict=True):
        writer.store(writer.write(result), i)
    builder.ret_void()
    return machine_code(str(module), host=writer.host)


def new_module() -> ir.Module:
    """A module of this machine."""
    module = ir.Module(name="phasekit")
    module.triple = llvm.get_process_triple()
    return module


def machine_code(text: str, *, host: bool, effort: int = 2) -> int:
    """Compile a module as text; return the address of its function ``fill``.

    Without effort the time grows with the length as it is, and values are kept in memory.
    """
    kind = target()
    module = llvm.parse_assembly(text)
    module.verify()
    options = dict(zip(("cpu", "features"), processor(), strict=True)) if host else {}
    engine = llvm.create_mcjit_compiler(module, kind.create_target_machine(opt=effort, **options))
    return finalized(engine, "fill")


class Writer:
    """Writes expressions as instructions; every value is a double."""

    kind: Any = _DOUBLE
    truth: Any = ir.IntType(1)
    #: Flags of sums and products.
    flags: tuple[str, ...] = ()
    #: Whether the code uses all that this machine's processor has.
    host = False

    def __init__(
        self,
        module: ir.Module,
        builder: ir.IRBuilder,
        arrays: Sequence[Any],
        inputs: Mapping[sympy.Symbol, tuple[int, int]],
    ) -> None:
        self.module, self.builder = module, builder
        self.arrays, self.inputs = arrays, inputs
        self.values: dict[Any, Any] = {}

    def constant(self, value: float) -> Any:
        """A number."""
        return ir.Constant(self.kind, value)

    def boolean(self, value: bool) -> Any:
        """A truth."""
        return ir.Constant(self.truth, int(value))

    def load(self, array: Any, index: int) -> Any:
        """An entry of an argument."""
        return self.builder.load(self.pointer(array, index))

    def store(self, value: Any, index: int) -> None:
        """Store an entry of the result."""
        self.builder.store(value, self.pointer(self.arrays[3], index))

    def pointer(self, array: Any, index: int) -> Any:
        """Pointer to an entry."""
        return self.builder.gep(array, [ir.Constant(ir.IntType(64), index)])

    def clear(self, array: Any, count: int) -> None:
        """Set so many entries to zero."""
        byte, long = ir.IntType(8), ir.IntType(64)
        memset = self.module.declare_intrinsic("llvm.memset", [byte.as_pointer(), long])
        start = self.builder.bitcast(array, byte.as_pointer())
        zero, no = ir.Constant(byte, 0), ir.Constant(ir.IntType(1), 0)
        self.builder.call(memset, [start, zero, ir.Constant(long, 8 * count), no])

    def library(self, name: str, *args: Any) -> Any:
        """Call a function of the C library."""
        known = self.module.globals.get(name)
        if known is None:
            kind = ir.FunctionType(_DOUBLE, [_DOUBLE] * len(args))
            known = ir.Function(self.module, kind, name=name)
        return self.builder.call(known, args)

    def write(self, expression: Any) -> Any:
        """The value of an expression."""
        if expression not in self.values:
            self.values[expression] = self._write(expression)
        return self.values[expression]

    def _write(self, e: Any) -> Any:
        b = self.builder
        if e.is_Symbol:
            which, index = self.inputs[e]
            return self.load(self.arrays[which], index)
        if e.is_number and e.is_real is not False:  # sympy does not know it of besselj(0, 2)
            return self.constant(float(e))
        if e.is_Add:
            # Products with a negative coefficient are subtracted.
            value = None
            for term in e.args:
                minus = term.could_extract_minus_sign()
                part = self.write(-term if minus else term)
                if value is None:
                    value = b.fneg(part) if minus else part
                else:
                    value = (
                        b.fsub(value, part, flags=self.flags)
                        if minus
                        else b.fadd(value, part, flags=self.flags)
                    )
            return value
        if e.is_Mul:
            return self._product(e)
        if e.is_Pow:
            return self.power(self.write(e.base), e)
        name = type(e).__name__
        if name in LIBRARY:
            return self.library(LIBRARY[name], self.write(e.args[0]))
        if name == "atan2":
            return self.library("atan2", *(self.write(x) for x in e.args))
        if name == "Abs":
            value = self.write(e.args[0])
            return b.select(b.fcmp_ordered("<", value, self.constant(0.0)), b.fneg(value), value)
        if name == "DiracDelta":
            return self.constant(0.0)  # the derivative of a jump, anywhere but on it
        if name in ("sign", "Heaviside"):
            value, zero = self.write(e.args[0]), self.constant(0.0)
            below, middle = (-1.0, 0.0) if name == "sign" else (0.0, 0.5)
            values = self.constant(below), self.constant(middle)
            other = b.select(b.fcmp_ordered("<", value, zero), *values)
            return b.select(b.fcmp_ordered(">", value, zero), self.constant(1.0), other)
        if name in ("Max", "Min"):
            value = self.write(e.args[0])
            for argument in e.args[1:]:
                other = self.write(argument)
                better = b.fcmp_ordered(">" if name == "Max" else "<", other, value)
                value = b.select(better, other, value)
            return value
        if name == "Piecewise":
            value = self.constant(math.nan)
            for part, condition in reversed(e.args):
                value = b.select(self.condition(condition), self.write(part), value)
            return value
        raise ParameterError(
            f"f: got the function {name} in {e}, wants elementary functions; "
            "a Python or numba-compiled f may hold any"
        )

    def condition(self, c: Any) -> Any:
        """The truth of a condition."""
        if c.is_Symbol:  # several functions share it
            return self.values[c]
        if c in (sympy.true, sympy.false):
            return self.boolean(bool(c))
        if type(c).__name__ in COMPARISONS:
            left, right = self.write(c.lhs), self.write(c.rhs)
            return self.builder.fcmp_ordered(COMPARISONS[type(c).__name__], left, right)
        if isinstance(c, (sympy.And, sympy.Or)):
            value = self.condition(c.args[0])
            for other in c.args[1:]:
                join = self.builder.and_ if isinstance(c, sympy.And) else self.builder.or_
                value = join(value, self.condition(other))
            return value
        if isinstance(c, sympy.Not):
            return self.builder.not_(self.condition(c.args[0]))
        raise ParameterError(f"f: got the condition {c}, wants comparisons")

    def _product(self, e: Any) -> Any:
        b = self.builder
        above, below = [], []
        for factor in e.args:
            if factor.is_Pow and factor.exp.is_number and factor.exp.is_negative:
                below.append(sympy.Pow(factor.base, -factor.exp))
            else:
                above.append(factor)
        minus = above and above[0] == -1
        if minus:
            above = above[1:]
        value = self.write(above[0]) if above else self.constant(1.0)
        for factor in above[1:]:
            value = b.fmul(value, self.write(factor), flags=self.flags)
        if below:
            divisor = self.write(below[0])
            for factor in below[1:]:
                divisor = b.fmul(divisor, self.write(factor))
            value = b.fdiv(value, divisor)
        return b.fneg(value) if minus else value

    def power(self, base: Any, e: Any) -> Any:
        """The value of a power whose base has a value."""
        b, exponent = self.builder, e.exp
        if exponent.is_Integer and 0 < abs(int(exponent)) <= LONGEST_POWER:
            value = self._repeated(base, abs(int(exponent)))
            return value if exponent > 0 else b.fdiv(self.constant(1.0), value)
        if exponent.is_Rational and exponent.q == 2 and abs(exponent.p) <= LONGEST_POWER:
            root = self.library("sqrt", base)
            value = self._repeated(root, abs(int(exponent.p)))
            return value if exponent > 0 else b.fdiv(self.constant(1.0), value)
        if e.base is sympy.E:
            return self.library("exp", self.write(exponent))
        return self.library("pow", base, self.write(exponent))

    def _repeated(self, value: Any, times: int) -> Any:
        result = None
        while True:
            if times & 1:
                result = value if result is None else self.builder.fmul(result, value)
            times >>= 1
            if not times:
                return result
            value = self.builder.fmul(value, value)
