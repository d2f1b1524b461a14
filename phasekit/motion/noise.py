"""Motions with additive white noise, dx = f dt + s dW, and the times at which they pass.

Each path has random numbers of its own: Philox's, whose key is a digest of the seed, the number of
the path, the parameters and the state at the start. So a path has the same bits wherever, and
beside whichever others, it is followed.
"""

from __future__ import annotations

import functools
import hashlib
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from phasekit.arrays import Array
from phasekit.errors import ConvergenceError
from phasekit.laws.equations import Equations
from phasekit.motion.equation_rates import parameters_of, pointwise, rates_of, slopes_at
from phasekit.motion.flow import Laid, motions
from phasekit.motion.flows import period_of
from phasekit.motion.method import WEIGHT, cells_of, single

#: Part of the fastest time of a motion that a step takes, unless the step is given.
PART = 0.05
#: Part of the damping by which Heun's steps may feed an oscillation.
FED = 0.01
#: Times along a motion without noise at which its rates are looked at.
LOOKS = 33
#: Steps and random numbers that are in memory at once.
CHUNK, MEMORY = 4096, 8_000_000
#: Steps that a path may take.
MOST = 1_000_000_000


def paths_at(
    law: Equations, *arrays: npt.ArrayLike, paths: int, seed: int, step: float | None,
    threads: int | None = None,
) -> dict[str, Array]:  # fmt: skip
    """States of paths at times >= 0, with the paths on a last axis, and the longest steps.

    Arrays are parameters, then states at t = 0, then times; they broadcast. The longest step is by
    default that of the rates along the motion without noise.
    """
    laid = Laid.out(len(law.names), arrays)
    values = dict(zip(law.names, laid.values, strict=True))
    count, n = laid.states.shape
    times = np.broadcast_to(laid.times, (count, laid.times.shape[1]))
    order = np.argsort(times, axis=1)
    rising = np.take_along_axis(times, order, axis=1)
    reach = np.max(np.where(np.isfinite(rising), rising, 0.0), axis=1, initial=0.0)
    longest = steps_of(law, values, laid.states, reach) if step is None else np.full(count, step)
    run = _Run(law, values, laid.states, paths, seed, longest, reach, threads)
    found = np.full((count * paths, times.shape[1], n), np.nan)
    now = np.zeros(count)
    for i in range(times.shape[1]):
        then = rising[:, i]
        valid = np.isfinite(then) & (then >= 0.0)
        run.move(now, np.where(valid, then, now))
        now = np.where(valid, then, now)
        found[:, i] = np.where(np.repeat(valid, paths)[:, None], run.states, np.nan)
    back = np.argsort(order, axis=1)
    found = found.reshape(count, paths, times.shape[1], n)
    found = np.take_along_axis(found, back[:, None, :, None], axis=2)
    bad = ~np.isfinite(found).all(axis=3)
    found[bad] = np.nan
    each = [np.stack(x, axis=-1) for x in zip(
        *(laid.back(np.ascontiguousarray(found[:, k])) for k in range(paths)), strict=True
    )]  # fmt: skip
    wide = np.repeat(longest[:, None, None], times.shape[1], axis=1)
    named = {f"motion_{name}": x for name, x in zip(law.states, each, strict=True)}
    return {**named, "noise_step": laid.back(wide)[0]}


def first_passages(
    law: Equations, target: Any, *arrays: npt.ArrayLike, paths: int, seed: int,
    step: float | None, threads: int | None = None,
) -> dict[str, Array]:  # fmt: skip
    """Times at which paths first pass a target, on a last axis: infinite if later than the last.

    The target is a formula; a path passes where it leaves the sign that it has at the start. Arrays
    are as of `paths_at`, the last the longest times.
    """
    own, states = arrays[: len(law.names)], arrays[len(law.names) : -1]
    laid = Laid.out(len(own) + 1, (*own, arrays[-1], *states, np.zeros(())))
    values = dict(zip(law.names, laid.values, strict=False))
    count = len(laid.states)
    reach = np.array(np.broadcast_to(laid.values[-1], (count,)))
    reach = np.where(np.isfinite(reach), reach, 0.0)
    longest = steps_of(law, values, laid.states, reach) if step is None else np.full(count, step)
    run = _Run(law, values, laid.states, paths, seed, longest, reach, threads)
    times = run.until(target, reach).reshape(count, 1, paths)
    found = np.stack(laid.back(times), axis=-1)
    return {"passage_time": found, "noise_step": laid.back(longest[:, None, None])[0]}


def steps_of(law: Equations, values: Mapping[str, Array], states: Array, reach: Array) -> Array:
    """Steps that are short beside all times in which the motions without noise change.

    They are a part of 1/r, r the greatest size of the eigenvalues of the slopes along the motion,
    and of the forcing. Heun's steps h feed an oscillation of frequency r by h^3 r^4/8: where there
    is damping, they are so short that this is a small part of it.
    """
    count, n = states.shape
    at = np.linspace(0.0, 1.0, LOOKS) * reach[:, None]
    along = np.empty((count, LOOKS, n))
    if law.kind == "python":
        along[:] = states[:, None]
    else:
        along[:] = motions(law, values, states, at).states
    rates, damping = np.zeros(count), np.zeros(count)
    names = list(law.names)
    for cell in range(count):
        own = single(cells_of(values, cell))
        good = np.isfinite(along[cell]).all(axis=1)
        slopes = [
            slopes_at(law, own, x, t)
            for x, t in zip(along[cell][good], at[cell][good], strict=True)
        ]
        slopes = [one for one in slopes if np.isfinite(one).all()]
        if not slopes:
            continue
        rates[cell] = np.abs(np.linalg.eigvals(np.array(slopes))).max()
        damping[cell] = -np.trace(np.array(slopes), axis1=1, axis2=2).mean() / n
        if law.period is not None:
            period = float(period_of(law, [np.asarray(own[name]) for name in names]))
            rates[cell] = max(rates[cell], 2.0 * np.pi / period)
    with np.errstate(divide="ignore", invalid="ignore"):
        steps = PART / rates
        fed = np.cbrt(8.0 * FED * damping / rates**4)
    steps = np.where(damping > 0.0, np.fmin(steps, fed), steps)
    whole = np.where(reach > 0.0, reach / LOOKS, 1.0)
    return np.fmin(np.where(np.isfinite(steps), steps, np.inf), whole)


class _Run:
    """Paths side by side: their states and their random numbers."""

    def __init__(
        self, law: Equations, values: Mapping[str, Array], states: Array, paths: int, seed: int,
        longest: Array, reach: Array, threads: int | None,
    ) -> None:  # fmt: skip
        count = len(states)
        with np.errstate(divide="ignore", invalid="ignore"):
            if np.any(reach / longest > MOST):
                raise ConvergenceError(
                    f"paths to t = {reach.max():.6g} in steps of {longest.min():.3g} take more "
                    f"than {MOST:.0e} steps; try a shorter time or a longer step"
                )
        self.law, self.threads, self.longest = law, threads, np.repeat(longest, paths)
        self.states = np.repeat(states, paths, axis=0)
        self.values = {
            name: np.repeat(np.broadcast_to(np.asarray(x, float), (count,)), paths)
            for name, x in values.items()
        }
        noise = _amplitudes(law)
        self.noisy = np.array([law.states.index(name) for name in law.noise], np.int64)
        columns = noise(*(self.values[name] for name in law.names)) if law.noise else []
        self.amplitudes = np.stack(
            [np.broadcast_to(np.asarray(x, float), (count * paths,)) for x in columns], axis=-1
        ) if law.noise else np.zeros((count * paths, 0))  # fmt: skip
        self.parameters = parameters_of(law, self.values, count * paths)
        row = np.ascontiguousarray(np.column_stack([*self.parameters, self.states]) + 0.0)
        self.keys = [
            _key(seed, row[i * paths + k].tobytes(), k) for i in range(count) for k in range(paths)
        ]
        self.normal = [np.random.Generator(np.random.Philox(key=key)) for key in self.keys]
        self.uniform: list[np.random.Generator] = []

    def move(self, begin: Array, end: Array) -> None:
        """Move all paths from times to later times."""
        for cells, begins, steps, counts in self._legs(begin, end):
            normals = self._draw(cells, counts)
            self._launch(None, cells, begins, steps, counts, normals, None)

    def until(self, target: Any, reach: Array) -> Array:
        """Times at which paths first pass a target."""
        passed = np.full(len(self.states), np.inf)
        watch = _watch(self.law, target)
        self.uniform = [np.random.Generator(np.random.Philox(key=key ^ 1)) for key in self.keys]
        #: For the step in which a path passes.
        self.ends = np.array([(one.standard_normal(), one.random()) for one in self.uniform])
        for cells, begins, steps, counts in self._legs(np.zeros(len(reach)), reach):
            on = passed[cells] == np.inf
            if not on.any():
                continue
            cells, begins, steps, counts = cells[on], begins[on], steps[on], counts[on]
            normals = self._draw(cells, counts)
            uniforms = np.zeros((len(cells), normals.shape[1]))
            if self.noisy.size:
                for row, cell in enumerate(cells):
                    self.uniform[cell].random(out=uniforms[row, : counts[row]])
            own = passed[cells]
            until = uniforms, self.ends[cells], own
            self._launch(watch, cells, begins, steps, counts, normals, until)
            passed[cells] = own
        passed[~np.isfinite(self.states).all(axis=1) & (passed == np.inf)] = np.nan
        return passed

    def _legs(self, begin: Array, end: Array) -> Any:
        """Paths in parts that fit into memory, each from time to time, with their equal steps."""
        from phasekit.numerics.waits import stage

        paths = len(self.states) // len(begin)
        first, last = np.repeat(begin, paths), np.repeat(end, paths)
        with np.errstate(divide="ignore", invalid="ignore"):
            wanted = np.ceil((last - first) / self.longest * (1.0 - 1e-12))
        total = np.where(last > first, np.maximum(wanted, 1.0), 0.0).astype(np.int64)
        steps = np.where(total > 0, (last - first) / np.maximum(total, 1), 0.0)
        many = max(len(self.noisy), 1)
        width = max(MEMORY // (min(int(total.max(initial=1)), CHUNK) * many), 8)
        for start in range(0, len(total), width):
            cells = np.arange(start, min(start + width, len(total)))
            for done in range(0, int(total[cells].max(initial=0)), CHUNK):
                counts = np.clip(total[cells] - done, 0, CHUNK)
                on = counts > 0
                own = cells[on]
                yield own, first[own] + done * steps[own], steps[own], counts[on]
                stage(f"{int(first[own[0]] + done * steps[own[0]])} of {int(last.max())} in time")

    def _draw(self, cells: npt.NDArray[np.int64], counts: npt.NDArray[np.int64]) -> Array:
        many = len(self.noisy)
        normals = np.zeros((len(cells), int(counts.max(initial=0)), many))
        if many:
            for row, cell in enumerate(cells):
                self.normal[cell].standard_normal(out=normals[row, : counts[row]])
        return normals

    def _launch(
        self, watch: Any, cells: Any, begins: Array, steps: Array, counts: Any, normals: Array,
        until: tuple[Array, Array, Array] | None,
    ) -> None:  # fmt: skip
        states = np.ascontiguousarray(self.states[cells])
        amplitudes = np.ascontiguousarray(self.amplitudes[cells])
        parameters = np.ascontiguousarray(self.parameters[:, cells])
        if self.law.kind == "python":
            self._one_by_one(watch, cells, begins, steps, counts, normals, until, states)
            self.states[cells] = states
            return
        from phasekit.motion.kernels import noise as kernels
        from phasekit.numerics.launch import launch

        code = rates_of(self.law).address
        given = self.noisy, begins, steps, counts, amplitudes, parameters, normals
        groups: Any
        work = WEIGHT + int(counts.max(initial=1)) // 4
        if until is None:
            groups = (states,)
            launch(kernels.heun, (code, *given), len(cells), groups, self.threads, work)
        else:
            uniforms, ends, own = until
            # The slopes of the target have the amplitudes as parameters behind the others.
            wide = np.concatenate([parameters[: len(self.law.names)], amplitudes.T])
            given = (*given[:-2], np.ascontiguousarray(wide), normals)
            arguments = (code, watch.address, *given, uniforms, ends)
            groups = (states, own)
            launch(kernels.heun_until, arguments, len(cells), groups, self.threads, work)
        self.states[cells] = states

    def _one_by_one(
        self, watch: Any, cells: Any, begins: Array, steps: Array, counts: Any, normals: Array,
        until: tuple[Array, Array, Array] | None, states: Array,
    ) -> None:  # fmt: skip
        """The same of a Python function."""
        from phasekit.motion.kernels.noise import passage

        for row, cell in enumerate(cells):
            rates = pointwise(self.law, {n: float(x[cell]) for n, x in self.values.items()})
            x, h, scale = states[row], steps[row], np.zeros(states.shape[1])
            scale[self.noisy] = self.amplitudes[cell] * np.sqrt(abs(h))
            par = [*self.parameters[:, cell][: len(self.law.names)], *self.amplitudes[cell]]
            for i in range(counts[row]):
                t = begins[row] + i * h
                before = None if until is None else watch.function(t, x, par)
                kick = np.zeros(len(x))
                kick[self.noisy] = scale[self.noisy] * normals[row, i]
                k = rates(t, x)
                y = x + h * k + kick
                x = x + 0.5 * h * (k + rates(t + h, y)) + kick
                if until is not None and before is not None:
                    (a, first), (b, last) = before, watch.function(t + h, x, par)
                    part = passage(a, b, 0.5 * (first + last), h, until[0][row, i], *until[1][row])
                    if np.isnan([a, b]).any() or part <= 1.0:
                        until[2][row] = np.nan if np.isnan([a, b]).any() else t + h * part
                        break
            states[row] = x


def _key(seed: int, row: bytes, path: int) -> int:
    """128 bits, which differ wherever one of these does."""
    said = f"{seed}:{path}:".encode() + row
    return int.from_bytes(hashlib.blake2b(said, digest_size=16).digest(), "little") & ~1


def _amplitudes(law: Equations) -> Callable[..., Any]:
    import sympy as sp

    from phasekit.laws.formulas import symbols_of

    symbols = symbols_of(law.names)
    formulas = list(law.noise.values())
    return sp.lambdify([symbols[name] for name in law.names], formulas, ["scipy", "numpy"])  # type: ignore[no-any-return]


class _Watch:
    """A function of the state, and the rate at which its square spreads by noise."""

    def __init__(self, law: Equations, target: Any) -> None:
        import sympy as sp

        from phasekit.laws.formulas import symbols_of

        clock = [] if law.time is None else [law.time]
        symbols = symbols_of([*law.states, *law.names, *clock])
        sizes = [sp.Dummy(f"s{i}", real=True) for i in range(len(law.noise))]
        spread = sp.Add(*(
            (size * target.diff(symbols[name])) ** 2
            for size, name in zip(sizes, law.noise, strict=True)
        ))  # fmt: skip
        self.formulas = (target, spread)
        self.states = [symbols[name] for name in law.states]
        self.parameters = [*(symbols[name] for name in law.names), *sizes]
        self.time = symbols[law.time] if law.time else sp.Dummy("t", real=True)

    @functools.cached_property
    def address(self) -> int:
        """Machine code for eight states."""
        from phasekit.numerics.lanes import compile_lanes

        places = {symbol: (0, i) for i, symbol in enumerate(self.states)}
        places |= {symbol: (1, i) for i, symbol in enumerate(self.parameters)}
        places[self.time] = (2, 0)
        return compile_lanes(self.formulas, places)

    @functools.cached_property
    def function(self) -> Callable[..., Any]:
        """The same of one state."""
        import sympy as sp

        return sp.lambdify([self.time, self.states, self.parameters], self.formulas, "numpy")  # type: ignore[no-any-return]


@functools.lru_cache(maxsize=64)
def _watch_of(states: Any, names: Any, time: Any, noise: Any, target: Any) -> _Watch:
    law = Equations(states, names, (), time=time, noise=dict(noise))
    return _Watch(law, target)


def _watch(law: Equations, target: Any) -> _Watch:
    return _watch_of(law.states, law.names, law.time, tuple(law.noise.items()), target)
