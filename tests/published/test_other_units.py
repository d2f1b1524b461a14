"""The same system in other units of its states, times and parameters: the same answers."""

import re

import numpy as np
import pytest

import phasekit as pk

#: Units of states, in order, of times and of parameters.
UNITS = {
    "small_slow": ([1e-9] * 3, 1e6, 1e-9),
    "large_fast": ([1e9] * 3, 1e-6, 1e9),
    "mixed": ([1e-9, 1e7, 1e-3], 1e-4, 1e5),
}
NEURON = {"v": "v - v^3/3 - w + i", "w": "0.08*(v + 0.7 - 0.8*w)"}, {"i": 0.5}, (3, 2)
NEURON_OF_TWO = {**NEURON[0], "w": "0.08*(v + 0.7 - b*w)"}, {"i": 0.0, "b": 0.8}, (3, 2)
WELLS = {"x": "y", "y": "x - x^3 - d*y"}, {"d": 0.2}, (2, 2)
SHAKEN = {"x": "y", "y": "x - x^3 - d*y + 0.1*cos(1.2*t)"}, {"d": 0.25}, (2, 2)
LORENZ = {"x": "10*(y - x)", "y": "x*(r - z) - y", "z": "x*y - 8/3*z"}, {"r": 14.0}, (25, 25, 60)
LOOP = {"x": "y", "y": "x - x^2 + m*y + x*y"}, {"m": -0.8}, (2, 2)
FRONT = {"x": "y", "y": "c*y - x*(1 - x)*(x - a)"}, {"c": 0.4, "a": 0.2}, (2, 1)
PATH = {"x": "p + x - x^3", "y": "x - y"}, {"p": -1.0}, (2, 3)


class Scaled:
    """A system in its units; results are turned back into the first ones."""

    def __init__(self, system, units, *, code=False, **changed):
        formulas, parameters, reach = system
        size, self.T, self.P = units
        self.names, self.S = list(formulas), np.array(size[: len(formulas)])
        own = dict(zip(self.names, self.S.tolist(), strict=True))
        own |= dict.fromkeys(parameters, self.P) | {"t": self.T}

        def unit(found):
            name = found.group()
            return f"({name}/{own[name]!r})" if name in own else name

        f = [f"{own[x] / self.T!r}*({re.sub(r'[a-z]+', unit, one)})" for x, one in formulas.items()]
        if code:
            compiled = [compile(one.replace("^", "**"), "f", "eval") for one in f]

            def f(x, **p):
                known = dict(zip(self.names, x.tolist(), strict=True)) | p
                return [eval(one, {}, known) for one in compiled]

        ends = (self.S * np.array(reach)).tolist()
        self.window = {name: (-one, one) for name, one in zip(self.names, ends, strict=True)}
        time = {"time": "t", "period": 2 * np.pi / 1.2 * self.T} if "t)" in str(formulas) else {}
        values = {name: one * self.P for name, one in (parameters | changed).items()}
        self.problem = pk.Problem(f, self.names, values, window=self.window, **time)

    def x(self, *x):
        return (np.array(x) * self.S).tolist()

    def grid(self, n):
        return {name: np.linspace(*ends, n) for name, ends in self.window.items()}

    def states(self, ds, prefix=""):
        return np.array(
            [ds[prefix + x].values / s for x, s in zip(self.names, self.S, strict=True)]
        )

    def special(self, branch, name):
        found = branch.special_points
        return [one.kind for one in found], [one.parameters[name] / self.P for one in found]


def rests(units, code=False):
    one = Scaled(NEURON, units, code=code)
    ds = pk.equilibria(one.problem)
    return ds.x / one.S, ds.eigenvalue * one.T, ds.kind


def rests_of_code(units):
    return rests(units, code=True)


def motion(units, code=False, system=NEURON):
    one = Scaled(system, units, code=code)
    ds = pk.flow(one.problem, x0=one.x(0.1, 0.2), t=np.linspace(0, 20, 5) * one.T)
    return (one.states(ds, "motion_"),)


def motion_of_code(units):
    return motion(units, code=True)


def shaken_motion(units):
    return motion(units, system=SHAKEN)


def events(units):
    one = Scaled(NEURON, units)
    times = np.linspace(0, 100, 3) * one.T
    return (
        pk.flow(one.problem, x0=one.x(0.1, 0.2), t=times, events={"e": "w"}).event_time / one.T,
    )


def strobed(units):
    one = Scaled(SHAKEN, units)
    return (one.states(pk.stroboscopic(one.problem, x0=one.x(0.1, 0), n=9), "section_"),)


def branch(units):
    one = Scaled(NEURON, units, i=0.0)
    x = pk.equilibria(one.problem).x.values[0].tolist()
    found = pk.continuation(one.problem, "i", x0=x, span=(0, 2 * one.P))
    family = next(p for p in found.special_points if p.kind == "hopf").switch()
    return *one.special(found, "i"), *one.special(family, "i")


def curve(units):
    one = Scaled(NEURON_OF_TWO, units)
    x = pk.equilibria(one.problem).x.values[0].tolist()
    found = pk.continuation(one.problem, "i", x0=x, span=(0, 2 * one.P))
    hopf = next(p for p in found.special_points if p.kind == "hopf")
    return one.special(hopf.curve("b", span=(0.5 * one.P, 1.5 * one.P)), "i")


def orbit(units, code=False):
    one = Scaled(NEURON, units, code=code)
    ds = pk.periodic_orbit(one.problem, one.x(1, 0))
    return ds.period / one.T, ds.multiplier


def orbit_of_code(units):
    return orbit(units, code=True)


def shaken_orbit(units):
    one = Scaled(SHAKEN, units)
    return (pk.periodic_orbit(one.problem, one.x(1, 0)).multiplier,)


def cycles(units):
    one = Scaled(NEURON, units)
    return (pk.periodic_orbits(one.problem).period / one.T,)


def loop(units):
    one = Scaled(LOOP, units)
    return (pk.connection(one.problem, (one.x(0, 0), one.x(0, 0)), free="m").points.m / one.P,)


def loop_in_space(units):
    one = Scaled(LORENZ, units)
    found = pk.connection(one.problem, (one.x(0, 0, 0), one.x(0, 0, 0)), free="r")
    return (found.points.r / one.P,)


def front(units):
    one = Scaled(FRONT, units)
    found = pk.connection(one.problem, (one.x(0, 0), one.x(1, 0)), free="c")
    curve = found.curve("a", (0.1 * one.P, 0.3 * one.P))
    return found.points.c / one.P, curve.points.c[[0, -1]] / one.P


def attracting(units, system=NEURON, **changed):
    one = Scaled(system, units, **changed)
    ds = pk.attractors(one.problem, one.grid(7))
    time = 1.0 if one.problem.time else one.T  # of a forced system in its periods
    return ds.attractor_kind, ds.attractor_period / time, ds.attractor_exponent * one.T


def attracting_rest(units):
    return attracting(units, i=0.0)


def attracting_shaken(units):
    return attracting(units, system=SHAKEN)


def basins(units):
    one = Scaled(WELLS, units)
    ds = pk.basins(one.problem, one.grid(11))
    return ds.basin, ds.basin_decided, ds.basin_time / one.T


def edge(units):
    one = Scaled(WELLS, units)
    return (one.states(pk.edge_state(one.problem, one.x(-1, 0), one.x(1, 0)), "attractor_"),)


def slowly(units):
    one = Scaled(PATH, units)
    ds = pk.quasi_static(one.problem, {"p": np.linspace(-1, 1, 11) * one.P})
    return ds.jumped, ds.jump_p / one.P, ds.x_max / one.S[0]


def exponents(units):
    """Of whole lengths: those over a finite time are of the units in which vectors are long."""
    one = Scaled(NEURON, units)
    ds = pk.lyapunov(one.problem, x0=one.x(1, 1), duration=100 * one.T)
    return (ds.lyapunov_sum * one.T,)


#: Calls, and what their numbers may differ by: what steps are allowed to be off where those are
#: chosen by other sizes, a fold's place by the root of rounding.
CALLS = {
    rests: 1e-12, rests_of_code: 1e-8, motion: 1e-11, motion_of_code: 1e-6, shaken_motion: 1e-11,
    events: 1e-11, strobed: 1e-11, branch: 1e-8, curve: 1e-8, orbit: 1e-7, orbit_of_code: 1e-6,
    shaken_orbit: 1e-9, cycles: 1e-9, loop: 1e-9, loop_in_space: 1e-9, front: 1e-9,
    attracting: 1e-8, attracting_rest: 1e-8, attracting_shaken: 1e-8, basins: 1e-8, edge: 1e-8,
    slowly: 1e-7, exponents: 1e-8,
}  # fmt: skip


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::UserWarning", "ignore::RuntimeWarning")
@pytest.mark.parametrize("call", CALLS, ids=lambda call: call.__name__)
def test_answers_do_not_depend_on_units(call):
    first = [np.asarray(one) for one in call(([1.0] * 3, 1.0, 1.0))]
    assert all(one.size for one in first)
    for name, units in UNITS.items():
        for one, other in zip(first, call(units), strict=True):
            if one.dtype.kind in "OU":
                assert one.tolist() == np.asarray(other).tolist(), name
                continue
            size = float(np.nanmax(np.abs(one)))
            np.testing.assert_allclose(
                other, one, rtol=CALLS[call], atol=CALLS[call] * size, err_msg=name
            )
