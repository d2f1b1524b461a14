"""Expressions to machine code for eight points at once, one in each lane of the processor.

Entry i of an argument stands in eight doubles, from place 8 i on. Sine and cosine are polynomials
after reduction by multiples of pi/2, without branches but for arguments beyond `LARGE`, which the
C library takes; what other functions there are, it takes lane by lane.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from llvmlite import ir

from phasekit.numerics.later import later
from phasekit.numerics.machine_code import Writer, compile_expressions
from phasekit.numerics.pointers import invoke as invoke

if TYPE_CHECKING:
    import sympy
else:
    sympy = later("sympy")

LANES = 8
#: Up to here the multiple of pi/2 has at most 20 bits, so that its product with `PARTS` is exact.
LARGE = 1.6e6
#: pi/2 in parts of 33, 33 and 53 bits.
PARTS = (1.5707963267341256, 6.077100506303966e-11, 2.0222662487959506e-21)

# (sin(r)/r - 1)/r^2 and ((cos(r) - 1)/r^2 + 1/2)/r^2 as polynomials in r^2: interpolation at the
# Chebyshev nodes of [0, (pi/4)^2] in 50 digits, errors below 3e-17 and 8e-19.
SINE = (
    -0.16666666666666666,
    0.008333333333330946,
    -0.0001984126983675497,
    2.755731610068303e-06,
    -2.5051131455427946e-08,
    1.591810123027412e-10,
)
COSINE = (
    0.041666666666666664,
    -0.0013888888888887395,
    2.4801587298763433e-05,
    -2.7557317270560326e-07,
    2.0876146024689747e-09,
    -1.1382614868556325e-11,
)

_LONG = ir.VectorType(ir.IntType(64), LANES)
#: Added and taken away again, it leaves a whole number, whose lowest bits are the lowest of both.
_ROUNDS = 1.5 * 2.0**52


class LaneWriter(Writer):
    """Writes expressions as instructions on eight doubles."""

    kind = ir.VectorType(ir.DoubleType(), LANES)
    truth = ir.VectorType(ir.IntType(1), LANES)
    flags = ("contract",)
    host = True

    def __init__(self, *arguments: Any) -> None:
        super().__init__(*arguments)
        self.turned: dict[Any, tuple[Any, Any]] = {}
        self.constants: dict[str, Any] = {}  # written as text once each

    def constant(self, value: float) -> Any:
        """The same number in all lanes."""
        bits = float(value).hex()  # 0 and -0 apart
        if bits not in self.constants:
            self.constants[bits] = ir.Constant(self.kind, [value] * LANES)
        return self.constants[bits]

    def boolean(self, value: bool) -> Any:
        """The same truth in all lanes."""
        return ir.Constant(self.truth, [int(value)] * LANES)

    def pointer(self, array: Any, index: int) -> Any:
        """Pointer to an entry."""
        start = super().pointer(array, index * LANES)
        return self.builder.bitcast(start, self.kind.as_pointer())

    def load(self, array: Any, index: int) -> Any:
        """Load an entry; arrays are aligned as doubles are."""
        return self.builder.load(self.pointer(array, index), align=8)

    def store(self, value: Any, index: int) -> None:
        """Store an entry of the result."""
        self.builder.store(value, self.pointer(self.arrays[3], index), align=8)

    def library(self, name: str, *args: Any) -> Any:
        """Call a function: sine and cosine as polynomials, others lane by lane."""
        if name == "sqrt":
            return self._intrinsic("sqrt", *args)
        if name not in ("sin", "cos"):
            return self._by_lane(name, *args)
        (angle,) = args
        if angle not in self.turned:
            self.turned[angle] = self._sine_and_cosine(angle)
        return self.turned[angle][name == "cos"]

    def _intrinsic(self, name: str, *args: Any) -> Any:
        name = f"llvm.{name}.v{LANES}f64"
        known = self.module.globals.get(name)
        if known is None:
            kind = ir.FunctionType(self.kind, [self.kind] * len(args))
            known = ir.Function(self.module, kind, name=name)
        return self.builder.call(known, args)

    def _by_lane(self, name: str, *args: Any) -> Any:
        b, result = self.builder, self.constant(0.0)
        for lane in range(LANES):
            place = ir.Constant(ir.IntType(32), lane)
            value = super().library(name, *(b.extract_element(x, place) for x in args))
            result = b.insert_element(result, value, place)
        return result

    def _sine_and_cosine(self, angle: Any) -> tuple[Any, Any]:
        b = self.builder
        size = self._intrinsic("fabs", angle)
        small = b.fcmp_unordered("<", size, self.constant(LARGE))  # or no number
        every = ir.Constant(ir.IntType(LANES), 2**LANES - 1)
        all_small = b.icmp_unsigned("==", b.bitcast(small, every.type), every)
        near = self._reduced(angle)
        first = b.block
        with b.if_then(b.not_(all_small), likely=False):
            # What one lane holds must not change the others by an ulp.
            far = [
                b.select(small, one, self._by_lane(name, angle))
                for name, one in zip(("sin", "cos"), near, strict=True)
            ]
            second = b.block
        found = []
        for one, other in zip(near, far, strict=True):
            phi = b.phi(self.kind)
            phi.add_incoming(one, first)
            phi.add_incoming(other, second)
            found.append(phi)
        return found[0], found[1]

    def _reduced(self, angle: Any) -> tuple[Any, Any]:
        b = self.builder
        rounds = self.constant(_ROUNDS)
        shifted = b.fadd(b.fmul(angle, self.constant(2.0 / 3.141592653589793)), rounds)
        k = b.fsub(shifted, rounds)
        r = angle
        for part in PARTS:
            r = b.fsub(r, b.fmul(k, self.constant(part), self.flags), self.flags)
        z = b.fmul(r, r)
        sine, cosine = (self._polynomial(z, numbers) for numbers in (SINE, COSINE))
        sine = self._sum(r, b.fmul(b.fmul(r, z), sine))
        half = self._sum(b.fmul(z, self.constant(-0.5)), b.fmul(b.fmul(z, z), cosine))
        cosine = b.fadd(self.constant(1.0), half)
        quarter = b.bitcast(shifted, _LONG)
        one, two, zero = (ir.Constant(_LONG, [value] * LANES) for value in (1, 2, 0))
        swap = b.icmp_signed("!=", b.and_(quarter, one), zero)
        found = []
        for turn, pair in ((quarter, (cosine, sine)), (b.add(quarter, one), (sine, cosine))):
            value = b.select(swap, *pair)
            minus = b.icmp_signed("!=", b.and_(turn, two), zero)
            found.append(b.select(minus, b.fneg(value), value))
        return found[0], found[1]

    def _polynomial(self, z: Any, numbers: Sequence[float]) -> Any:
        value = self.constant(numbers[-1])
        for number in numbers[-2::-1]:
            value = self._sum(self.builder.fmul(value, z, self.flags), self.constant(number))
        return value

    def _sum(self, x: Any, y: Any) -> Any:
        return self.builder.fadd(x, y, flags=self.flags)


def compile_lanes(
    expressions: Sequence[sympy.Expr] | Mapping[int, sympy.Expr],
    inputs: Mapping[sympy.Symbol, tuple[int, int]],
) -> int:
    """Address of ``void (double *x, double *p, double *z, double *out)``, of eight lanes each.

    Inputs tell of each symbol which array it is in, 0 for x, 1 for p, 2 for z, and its place.
    """
    return compile_expressions(expressions, inputs, writer_class=LaneWriter)
