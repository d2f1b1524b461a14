"""Steps of maps as machine code that stands in place of steps by series: a time is a count.

So everything that is done along motions of flows is done along orbits of maps by the same kernels.
"""

from __future__ import annotations

import functools
from typing import Any

import llvmlite.binding as llvm
import numpy as np
from llvmlite import ir

from phasekit.motion.kernels.dop853 import ALONE
from phasekit.motion.kernels.stepping import COUNT, END, GONE, OUTCOME, SCALE, START, T
from phasekit.motion.lost import ARRIVED, FAILED, RUNNING
from phasekit.numerics.lanes import LANES, LaneWriter
from phasekit.numerics.machine_code import machine_code


@functools.cache
def compile_iterations(address: int, entries: int, turns: tuple[float, ...] = ()) -> int:
    """Address of ``void (double *x, double *p, double *real, double *limits)``.

    The machine code takes states and tangent vectors, in so many entries; states that have turns
    are brought back into half a turn about zero.
    """
    double = ir.DoubleType()
    pointer = double.as_pointer()
    module = ir.Module(name="phasekit")
    module.triple = llvm.get_process_triple()
    kind = ir.FunctionType(ir.VoidType(), [pointer] * 4)
    function = ir.Function(module, kind, name="fill")
    entry, step, end = (function.append_basic_block() for _ in range(3))
    builder = ir.IRBuilder(entry)
    room = builder.alloca(ir.ArrayType(double, (entries + 3) * LANES))
    clock = builder.bitcast(room, pointer)
    out = builder.gep(clock, [ir.Constant(ir.IntType(64), 3 * LANES)])
    builder.branch(step)
    builder.position_at_end(step)
    writer = IterationWriter(module, builder, function.args, {})
    code = builder.inttoptr(ir.Constant(ir.IntType(64), address), kind.as_pointer())
    builder.cbranch(writer.step(code, clock, out, entries, turns), step, end)
    builder.position_at_end(end)
    builder.ret_void()
    return machine_code(str(module), host=True)


class IterationWriter(LaneWriter):
    """Writes one step."""

    def step(self, code: Any, clock: Any, out: Any, entries: int, turns: tuple[float, ...]) -> Any:
        """Apply the map to the lanes that run; return whether to go on with all of them."""
        b, (x, p, real, limits) = self.builder, self.arrays
        one, zero = self.constant(1.0), self.constant(0.0)
        state, t = self.load(real, OUTCOME), self.load(real, T)
        b.store(t, self.pointer(clock, 0), align=8)
        for row in (1, 2):
            b.store(zero, self.pointer(clock, row), align=8)
        b.call(code, [x, p, clock, out])
        running = b.fcmp_ordered("==", state, self.constant(RUNNING))
        whole = self.boolean(True)
        for i in range(entries):
            value = self.load(out, i)
            if i < len(turns) and turns[i] > 0.0:
                value = self.folded(value, turns[i])
            size = self._intrinsic("fabs", value)
            whole = b.and_(whole, b.fcmp_ordered("<", size, self.constant(np.inf)))
            b.store(b.select(running, value, self.load(x, i)), self.pointer(x, i), align=8)
        now = b.select(running, b.fadd(t, one), t)
        new = b.select(
            b.fcmp_ordered(">=", now, self.load(real, END)),
            self.constant(ARRIVED), self.constant(RUNNING),
        )  # fmt: skip
        new = b.select(running, b.select(whole, new, self.constant(FAILED)), state)
        count = b.fadd(self.load(real, COUNT), one)
        gone = b.select(running, one, zero)
        rows = (T, now), (OUTCOME, new), (COUNT, count), (GONE, gone), (START, t), (SCALE, one)
        for row, value in rows:
            b.store(value, self.pointer(real, row), align=8)
        ended = b.bitcast(b.fcmp_ordered("!=", new, state), ir.IntType(LANES))
        none = b.icmp_unsigned("==", ended, ir.Constant(ended.type, 0))
        first = b.load(super(LaneWriter, self).pointer(limits, ALONE * LANES))
        alone = b.fcmp_ordered("!=", first, ir.Constant(ir.DoubleType(), 0.0))
        return b.and_(none, b.not_(alone))

    def folded(self, value: Any, turn: float) -> Any:
        """Bring an angle back by whole turns, to the nearest of which doubles round."""
        b, big = self.builder, self.constant(1.5 * 2.0**52)
        turned = b.fsub(b.fadd(b.fdiv(value, self.constant(turn)), big), big)
        return b.fsub(value, b.fmul(turned, self.constant(turn)))
