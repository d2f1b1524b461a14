"""Steps of eight motions by their Taylor series in time, written as machine code for each law.

A motion x'' = f(t, x, x') has the coefficients x_(k+2) = f_k/((k + 1)(k + 2)), each state of a
flow x' = f(t, x) the coefficients x_(k+1) = f_k/(k + 1), in units of the step before, so that no
power of a time over- or underflows. The step is as long as the last two coefficients allow
[JorbaZou2005]; whether the series holds at its end, the law says there: the series' own x'' or x'
must be f, to what the error of the state allows. [JorbaZou2005] section 3.
"""

from __future__ import annotations

import functools
import itertools
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import llvmlite.binding as llvm
import numpy as np
from llvmlite import ir

from phasekit.motion.kernels.dop853 import (
    ALONE,
    ATOL,
    BESIDE,
    CLOSEST,
    KEEP,
    LEAST,
    LONGEST,
    MOST,
    OWN,
    RTOL,
    UNIT,
)
from phasekit.motion.kernels.stepping import COUNT, END, KEPT, OUTCOME, REFUSED, SIZE, TRIAL, H, T
from phasekit.motion.lost import ARRIVED, EXHAUSTED, FAILED, RUNNING
from phasekit.numerics.lanes import LANES, LaneWriter
from phasekit.numerics.later import later
from phasekit.numerics.machine_code import machine_code
from phasekit.numerics.series import Series

if TYPE_CHECKING:
    import sympy as sp
else:
    sp = later("sympy")

_EPS = float(np.finfo(float).eps)
_LONG = ir.VectorType(ir.IntType(64), LANES)
_FACTOR = float(np.log2(LONGEST))


class Law:
    """The law of a motion, and where its symbols stand.

    Chains of symbols are a coordinate and its rate, or single states of a flow, then those of
    tangent vectors, of as many chains; each chain has the formula of its last derivative.
    Parameters have a place each in the array p.
    """

    def __init__(
        self,
        time: Any,
        chains: Sequence[tuple[Any, ...]],
        forces: Sequence[Any],
        parameters: Mapping[Any, int],
        width: int = 1,
    ) -> None:
        self.time, self.chains, self.width = time, chains, width
        self.degree = len(chains[0])
        self.inputs = {symbol: (1, place) for symbol, place in parameters.items()}
        symbols = sp.numbered_symbols("_c")
        self.shared, self.forces = sp.cse(list(forces), symbols=symbols, list=True)


def compile_steps(law: Law, order: int) -> int:
    """Address of ``void (double *x, double *p, double *real, double *limits)``.

    It takes steps, of all lanes at once, until a lane ends, or one alone; and may leave the
    coefficients of the coordinates in further rows of `real`.
    """
    pointer = ir.DoubleType().as_pointer()
    module = ir.Module(name="phasekit")
    module.triple = llvm.get_process_triple()
    kind = ir.FunctionType(ir.VoidType(), [pointer] * 4)
    function = ir.Function(module, kind, name="fill")
    entry, step, end = (function.append_basic_block() for _ in range(3))
    builder = ir.IRBuilder(entry)
    builder.branch(step)
    builder.position_at_end(step)
    writer = StepWriter(module, builder, function.args, law.inputs)
    builder.cbranch(writer.step(law, order), step, end)
    builder.position_at_end(end)
    builder.ret_void()
    return machine_code(str(module), host=True)


class StepWriter(LaneWriter):
    """Writes one step."""

    def step(self, law: Law, order: int) -> Any:
        """Try a step of every lane; return whether to go on with all of them."""
        b, (x, _, real, limits) = self.builder, self.arrays
        start = [self.load(x, i) for i in range(law.degree * len(law.chains))]
        t, end, count, state, refused = (
            self.load(real, row) for row in (T, END, COUNT, OUTCOME, REFUSED)
        )
        alone, keep = self._asked(ALONE), self._asked(KEEP)
        rest, h = b.fsub(end, t), self.load(real, H)
        h = b.select(b.fcmp_unordered("==", h, self.constant(0.0)), rest, h)
        running = b.fcmp_ordered("==", state, self.constant(RUNNING))
        per = b.fdiv(self.constant(1.0), h)
        curves = self._curves(law, order, t, start, h, per)
        own = map(self._size, start[: law.degree * law.width])
        size = functools.reduce(self._larger, own, self.load(real, SIZE))
        b.store(size, self.pointer(real, SIZE), align=8)
        allowed = self._allowed(law, curves, size, h, per)
        next_ = self._mul(self._part(order, curves, allowed, per, refused), h)
        far, long = self._size(rest), self._size(next_)
        last = b.fcmp_ordered(">=", long, far)
        # Rather than leave a short one.
        halves = b.fcmp_ordered(">", long, self._mul(self.constant(0.5), far))
        taken = b.select(halves, self._mul(self.constant(0.5), rest), next_)
        taken = b.select(last, rest, taken)
        then = b.select(last, end, b.fadd(t, taken))
        ends, error = self._end(law, curves, allowed, then, taken, per)
        good = b.fcmp_ordered("<=", error, self.constant(1.0))
        going = b.and_(good, running)
        for i, (old, new) in enumerate(zip(start, ends, strict=True)):
            b.store(b.select(going, new, old), self.pointer(x, i), align=8)
        self._keep(
            keep, [b.select(going, taken, self.constant(0.0)), t, h, *itertools.chain(*curves)]
        )
        h = b.select(good, next_, self._mul(self.constant(0.5), taken))
        now = b.select(going, then, t)
        count = b.fadd(count, self.constant(1.0))
        least = self._mul(self.constant(4.0 * _EPS), self._size(now))
        short = b.or_(
            b.fcmp_unordered("<=", self._size(h), least),
            b.fcmp_unordered("==", h, self.constant(0.0)),
        )
        most = self.load(limits, MOST)
        ahead = self._size(b.fdiv(rest, h))
        foreseen = b.and_(
            b.fcmp_ordered(">=", count, self.constant(TRIAL)), b.fcmp_ordered(">", ahead, most)
        )
        many = b.or_(b.fcmp_ordered(">=", count, most), foreseen)
        new = b.select(many, self.constant(EXHAUSTED), self.constant(RUNNING))
        new = b.select(b.and_(going, last), self.constant(ARRIVED), new)
        new = b.select(b.and_(b.not_(good), short), self.constant(FAILED), new)
        refused = b.select(good, self.constant(0.0), self.constant(1.0))
        for row, value in ((T, now), (H, h), (COUNT, count), (REFUSED, refused)):
            b.store(value, self.pointer(real, row), align=8)
        new = b.select(running, new, state)
        b.store(new, self.pointer(real, OUTCOME), align=8)
        ended = b.bitcast(b.fcmp_ordered("!=", new, state), ir.IntType(LANES))
        none = b.icmp_unsigned("==", ended, ir.Constant(ended.type, 0))
        return b.and_(none, b.not_(alone))

    def _asked(self, row: int) -> Any:
        """Whether a limit is not 0; it is the same in all lanes."""
        first = self.builder.load(super(LaneWriter, self).pointer(self.arrays[3], row * LANES))
        return self.builder.fcmp_ordered("!=", first, ir.Constant(ir.DoubleType(), 0.0))

    def _keep(self, keep: Any, values: Iterable[Any]) -> None:
        """Leave a step where the caller finds it."""
        with self.builder.if_then(keep):
            for row, value in enumerate(values):
                self.builder.store(value, self.pointer(self.arrays[2], KEPT + row), align=8)

    def _curves(
        self, law: Law, order: int, t: Any, start: Sequence[Any], h: Any, per: Any
    ) -> list[list[Any]]:
        """Coefficients of the coordinates in powers of the time over h."""
        degree = law.degree
        curves = [[x] for x in start[::degree]]
        if degree == 2:
            for curve, v in zip(curves, start[1::2], strict=True):
                curve.append(self._mul(v, h))

        def rate(i: int, k: int) -> Any:
            if k == 0:
                return start[2 * i + 1]
            return self._mul(self._mul(self.constant(k + 1), per), curves[i][k + 1])

        varying: dict[Any, Any] = {law.time: lambda k: (t, h)[k] if k < 2 else None}
        for i, (x, *rates) in enumerate(law.chains):
            varying[x] = functools.partial(lambda i, k: curves[i][k], i)
            varying.update((v, functools.partial(rate, i)) for v in rates)
        series = Series(self, varying, law.shared)
        power = self._mul(h, h) if degree == 2 else h
        for k in range(order + 1 - degree):
            part = (k + 1) * (k + 2) if degree == 2 else k + 1
            scale = self._mul(power, self.constant(1.0 / part))
            for curve, force in zip(curves, law.forces, strict=True):
                term = series.term(force, k)
                curve.append(self.constant(0.0) if term is None else self._mul(term, scale))
        return curves

    def _allowed(
        self, law: Law, curves: Sequence[Sequence[Any]], size: Any, h: Any, per: Any
    ) -> list[tuple[Any, ...]]:
        """Errors that are allowed, of each chain: of its state, or of a coordinate and its rate."""
        limits = self.arrays[3]
        rtol, atol, unit = (self.load(limits, row) for row in (RTOL, ATOL, UNIT))
        found: list[tuple[Any, ...]] = []
        if law.degree == 2:
            found.append(self._allowed_pair(curves[0], per, size, rtol, atol, unit))
            rates = [(curve[0], self._mul(curve[1], per)) for curve in curves[1:]]
            return found + [2 * (self._allowed_beside(one, h, rtol, atol),) for one in rates]
        n = law.width
        for i, curve in enumerate(curves[:n]):
            unit, scale = (self.load(limits, OWN + 2 * i + j) for j in range(2))
            given = self.builder.fcmp_ordered(">", scale, self.constant(0.0))
            least = self.builder.select(given, scale, self._smaller(size, self.constant(1.0)))
            reach = self._smaller(self._larger(*map(self._size, curve[:2])), unit)
            least = self._larger(self._mul(atol, least), self.constant(LEAST))
            found.append((self._sum(self._mul(rtol, reach), least),))
        for i in range(n, len(curves), n):
            vector = [curve[0] for curve in curves[i : i + n]]
            found += n * [(self._allowed_beside(vector, h, rtol, atol),)]
        return found

    def _allowed_pair(
        self, curve: Sequence[Any], per: Any, size: Any, rtol: Any, atol: Any, unit: Any
    ) -> tuple[Any, Any]:
        """Errors of the coordinate and its rate that are allowed, as of Runge-Kutta steps.

        What a step adds counts as the size of what is zero at its start. The rounding of a far
        coordinate is no error of the rate.
        """
        b, x, v = self.builder, curve[0], self._mul(curve[1], per)
        bend = self._size(curve[2])
        change = self._size(self._mul(self._mul(self.constant(2.0), curve[2]), per))
        far = self._larger(self._size(x), self._size(curve[1]))
        fast = self._larger(self._size(v), change)
        size = self._larger(size, self._larger(self._larger(far, bend), fast))
        line = b.fcmp_ordered("==", unit, self.constant(float("inf")))
        own = self._smaller(b.select(line, size, unit), self.constant(1.0))
        least = self._larger(self._mul(atol, own), self.constant(LEAST))
        a = self._sum(self._mul(rtol, self._smaller(far, unit)), least)
        # Of a rate, what adds up to that in a step, if that is longer than a second.
        part = self._mul(least, self._smaller(self._size(per), self.constant(1.0)))
        c = self._sum(self._mul(rtol, fast), part)
        noise = self._size(self._mul(self._mul(self.constant(_EPS), x), per))
        return a, self._larger(c, noise)

    def _allowed_beside(self, vector: Sequence[Any], h: Any, rtol: Any, atol: Any) -> Any:
        """That of the entries of a tangent vector: by its length."""
        squares = [self._mul(x, x) for x in vector]
        length = self._intrinsic("sqrt", functools.reduce(self._sum, squares))
        second = self._smaller(self._size(h), self.constant(1.0))
        part = self._mul(self._sum(self._mul(rtol, length), atol), second)
        part = self._larger(part, self._mul(self.constant(CLOSEST), length))
        return self._mul(part, self.load(self.arrays[3], BESIDE))

    def _part(
        self,
        order: int,
        curves: Sequence[Sequence[Any]],
        allowed: Sequence[tuple[Any, ...]],
        per: Any,
        refused: Any,
    ) -> Any:
        """How many times as long as the step before the next may be: by the last two terms."""
        found = None
        for k in (order, order - 1):
            most = None
            for curve, (a, *c) in zip(curves, allowed, strict=True):
                term = self._size(curve[k])
                parts = [self.builder.fdiv(term, a)]
                for least in c:
                    rate = self._mul(self._mul(self.constant(k), self._size(per)), term)
                    parts.append(self.builder.fdiv(rate, least))
                for part in parts:
                    most = part if most is None else self._larger(part, most)
            root = self._mul(self._log2(most), self.constant(-1.0 / (k + 1 - len(allowed[0]))))
            found = root if found is None else self._smaller(root, found)
        # After one that was refused, not longer than half of that.
        again = self.builder.fcmp_ordered(">", refused, self.constant(0.0))
        most = self.builder.select(again, self.constant(0.0), self.constant(_FACTOR))
        return self._exp2(self._larger(self._smaller(found, most), self.constant(-1000.0)))

    def _end(
        self,
        law: Law,
        curves: Sequence[Sequence[Any]],
        allowed: Sequence[tuple[Any, ...]],
        then: Any,
        taken: Any,
        per: Any,
    ) -> tuple[list[Any], Any]:
        """States at the end of the step, and their error over what is allowed."""
        s = self._mul(taken, per)
        ends, lasts = [], []
        for curve in curves:
            # Horner's scheme with the first derivative, and half of the second.
            value, slope, bend = curve[-1], self.constant(0.0), self.constant(0.0)
            for term in curve[-2::-1]:
                if law.degree == 2:
                    bend = self._sum(self._mul(bend, s), slope)
                slope = self._sum(self._mul(slope, s), value)
                value = self._sum(self._mul(value, s), term)
            rate = self._mul(slope, per)
            ends += [value, rate][: law.degree]
            twice = self._mul(self.constant(2.0), bend)
            lasts.append(self._mul(twice, self._mul(per, per)) if law.degree == 2 else rate)
        there = type(self)(self.module, self.builder, self.arrays, self.inputs)
        there.values.update(self.values)  # what does not vary
        there.values[law.time] = then
        there.values.update(zip(itertools.chain(*law.chains), ends, strict=True))
        for symbol, part in law.shared:
            there.values.setdefault(symbol, there.write(part))
        # What is missing of x'' grows as the power order - 1 of the time, of x' as the power order.
        error, order = None, len(curves[0]) - 1
        for force, last, (a, *c) in zip(law.forces, lasts, allowed, strict=True):
            missing = self._size(self._mul(self.builder.fsub(there.write(force), last), taken))
            parts = []
            for least in c:
                missing = self._mul(missing, self.constant(1.0 / order))
                parts.append(self.builder.fdiv(missing, least))
            rest = self.constant(1.0 / (order + 1))
            value = self._mul(missing, self._mul(self._size(taken), rest) if c else rest)
            for part in (*parts, self.builder.fdiv(value, a)):
                error = part if error is None else self._sum(part, error)
        return ends, error

    def _size(self, x: Any) -> Any:
        return self._intrinsic("fabs", x)

    def _mul(self, x: Any, y: Any) -> Any:
        return self.builder.fmul(x, y, flags=self.flags)

    def _larger(self, x: Any, y: Any) -> Any:
        return self.builder.select(self.builder.fcmp_ordered(">", x, y), x, y)

    def _smaller(self, x: Any, y: Any) -> Any:
        return self.builder.select(self.builder.fcmp_ordered("<", x, y), x, y)

    def _log2(self, x: Any) -> Any:
        """Logarithm of a positive number within 0.09, from its bits; large of NaN."""
        bits = self.builder.sitofp(self.builder.bitcast(x, _LONG), self.kind)
        return self._sum(self._mul(bits, self.constant(2.0**-52)), self.constant(-1023.0))

    def _exp2(self, x: Any) -> Any:
        """Power of two within a hundredth, of an exponent of a size below 1000."""
        b, whole = self.builder, self._intrinsic("floor", x)
        part = b.fsub(x, whole)
        factor = self._sum(self._mul(part, self.constant(0.34)), self.constant(0.66))
        factor = self._sum(self._mul(part, factor), self.constant(1.0))
        shift = b.shl(b.fptosi(whole, _LONG), ir.Constant(_LONG, [52] * LANES))
        return b.bitcast(b.add(b.bitcast(factor, _LONG), shift), self.kind)
