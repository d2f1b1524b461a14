"""The demos of AUTO-07p, stated anew, and the values that AUTO prints, beside those found here.

A demo yields what is compared, the value printed and the value found. The equations and the values
are those of the manual and of runs of AUTO-07p of 2024 with the constants that its demos have, or,
where more digits stand, with a finer mesh and tolerances of 1e-9 or less; no code was taken over.
``python tests/published/auto_demos.py`` writes the table of the documentation.
"""

from __future__ import annotations

import inspect
import sys
import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline

import phasekit as pk

Compared = Iterator[tuple[str, Any, Any]]


@dataclass(frozen=True)
class Demo:
    """A demo, what it asks for, and the relative difference from AUTO's digits that is allowed."""

    asks: str
    run: Callable[[], Compared]
    within: float

    @property
    def lines(self) -> int:
        """Lines of the statement and the calls."""
        return len(inspect.getsource(self.run).splitlines()) - 2


DEMOS: dict[str, Demo] = {}


def demo(asks: str, within: float = 3e-6) -> Callable[[Callable[[], Compared]], Any]:
    """Keep a demo under the name of its function."""

    def keep(run: Callable[[], Compared]) -> Callable[[], Compared]:
        DEMOS[run.__name__.rstrip("_")] = Demo(asks, run, within)
        return run

    return keep


def few(points: int) -> pk.ContinuationOptions:
    return pk.ContinuationOptions(max_points=points)


def values(points: Any, name: str) -> list[float]:
    return sorted(point[name] for point in points)


def at(branch: Any, name: str, value: float, of: str) -> float:
    """A column where another one, along which it is single-valued, has a value."""
    x, y = branch.points[name].values, branch.points[of].values
    _, i = np.unique(x, return_index=True)
    return float(CubicSpline(x[i], y[i])(value))


# ---- equilibria and maps


@demo("folds of a cubic, their curve and its cusp")
def cusp() -> Compared:
    law = pk.Problem({"x": "mu + l*x - x^3"}, parameters={"mu": 0.0, "l": 1.0})
    folds = pk.continuation(law, "mu", span=(-2, 2)).special("LP")
    yield "folds", [-0.384900, 0.384900], values(folds, "mu")
    yield "cusp", 0.0, folds[0].curve("l", (-1, 3)).special("CP")[0]["l"]


@demo("folds and branch points of two coupled cells")
def enz() -> Compared:
    law = pk.Problem(
        {"s": "s0 - 2*s + r - R(s)", "r": "s0 - 2*r + s - R(r)"},
        parameters={"s0": 0.0},
        functions={"R(x)": "100*x/(1 + x + x^2)"},
    )
    rest = pk.continuation(law, "s0", span=(0, 40))
    yield "folds", [18.8871, 34.3569], values(rest.special("LP"), "s0")
    one = rest.special("BP")[0].switch()
    yield "its folds", [25.3727, 25.3727, 26.6221, 26.6221], values(one.special("LP"), "s0")
    yield "branch points", [22.1816, 34.2229], values(rest.special("BP"), "s0")


@demo("fixed points of a planar map, their doublings")
def dd2() -> Compared:
    law = pk.Problem(
        {"u": "p1*u*(1 - u) - p2*u*v", "v": "0.9*v + p2*u*v"},
        parameters={"p1": 0.0, "p2": 0.2},
        map=True,
    )
    zero = pk.continuation(law, "p1", span=(0, 5)).special("BP")[0]
    one = zero.switch()
    yield "branch point", 2.0, max(values(one.special("BP"), "p1"))
    doubling = [point for point in one.special("PD") if point["p1"] > 2][0]
    for printed in (3.0, 3.44949, 3.54410):
        yield "doubling", printed, doubling["p1"]
        if printed < 3.5:
            more = doubling.switch().special("PD")
            doubling = [point for point in more if point["p1"] > printed + 1e-4][0]


@demo("a cascade of doublings")
def log() -> Compared:
    law = pk.Problem({"x": "mu*x*(1 - x)"}, parameters={"mu": 0.5}, map=True)
    one = pk.continuation(law, "mu", span=(0.5, 3.6)).special("BP")[0].switch()
    doubling = one.special("PD")[0]
    for printed in (3.0, 3.44949, 3.54409, 3.56441, 3.56876):
        yield "doubling", printed, doubling["mu"]
        more = doubling.switch().special("PD")
        doubling = [point for point in more if point["mu"] > printed + 1e-4][0]


@demo("curves of doublings and tori of the Hénon map, with resonances")
def hen() -> Compared:
    law = pk.Problem({"x": "y", "y": "a - b*x - y^2"}, parameters={"a": 2.0, "b": 0.0}, map=True)
    rest = pk.continuation(law, "b", x0=[1.0, 1.0], span=(0, 1.5))
    yield "doubling", 0.632992, rest.special("PD")[0]["b"]
    torus = rest.special("TR")[0].curve("a", (-1.5, 3.5))
    for label, printed in (("R2", 3.0), ("R3", 1.25), ("R4", 0.0), ("R1", -1.0)):
        yield label, printed, torus.special(label)[0]["a"]
    yield "LPD", -1.0, rest.special("PD")[0].curve("a", (-0.5, 4)).special("LPPD")[0]["b"]


@demo("curves of branch points")
def apbp() -> Compared:
    law = pk.Problem({"x": "(x - a)*(x - b) + c"}, parameters={"a": 1.0, "b": 2.0, "c": 0.0})
    point = pk.continuation(law, "a", x0=[1.0], span=(0, 3)).special("BP")[0]
    yield "branch point", 2.0, point["a"]
    curve = point.curve("b", (1, 3)).points
    yield "a - b on the curve", 0.0, float(np.abs(curve.a - curve.b).max())


@demo("the largest sum on a sphere, by its first-order conditions")
def opt() -> Compared:
    x = [f"x{i}" for i in range(5)]
    law = {name: f"w{i} - 2*m*{name}" for i, name in enumerate(x)}
    law["m"] = " + ".join(f"{name}^2" for name in x) + " - 1"
    weights = {"w0": 1.0, **{f"w{i}": 0.0 for i in range(1, 5)}}
    state = np.array([1.0, 0, 0, 0, 0, 0.5])
    for i, printed in enumerate((1.41421, 1.73205, 2.0, 2.23607), start=1):
        part = pk.continuation(pk.Problem(law, parameters=weights), f"w{i}", x0=state, span=(0, 1))
        state = np.array([float(part.points[name][-1]) for name in (*x, "m")])
        weights[f"w{i}"] = 1.0
        yield f"largest sum of {i + 1}", printed, float(state[:5].sum())


# ---- cycles


@demo("a Hopf point of a reaction")
def ab() -> Compared:
    law = pk.Problem(
        {"u": "-u + p1*(1 - u)*exp(v)", "v": "-v + 14*p1*(1 - u)*exp(v) - p3*v"},
        parameters={"p1": 0.0, "p3": 3.0},
    )
    hopf = pk.continuation(law, "p1", span=(0, 0.25)).special("H")[0]
    yield "Hopf", 0.165042, hopf["p1"]


@demo("Lorenz: pitchfork and Hopf point")
def lrz() -> Compared:
    law = pk.Problem(
        {"x": "10*(y - x)", "y": "r*x - y - x*z", "z": "x*y - 8/3*z"}, parameters={"r": 0.5}
    )
    fork = pk.continuation(law, "r", span=(0, 30)).special("BP")[0]
    yield "branch point", 1.0, fork["r"]
    yield "Hopf", 24.7368, fork.switch().special("H")[0]["r"]


ABC = {
    "x": "-x + d*(1 - x)*exp(z)",
    "y": "-y + d*exp(z)*(1 - x - s*y)",
    "z": "-z - be*z + d*b*exp(z)*(1 - x + al*s*y)",
}
RATES = {"d": 0.0, "al": 1.0, "be": 1.55, "b": 8.0, "s": 0.04}


@cache
def reaction() -> tuple[Any, Any]:
    """The Hopf points of the reaction, and folds of the cycles of the first one."""
    hopf = pk.continuation(pk.Problem(ABC, parameters=RATES), "d", span=(0, 0.4)).special("H")
    return hopf, hopf[0].switch(options=few(40)).special("LPC")


@demo("four Hopf points and folds of their cycles", within=2e-5)
def abc() -> Compared:
    hopf, folds = reaction()
    yield "Hopf", [0.204185, 0.229836, 0.259957, 0.346208], values(hopf, "d")
    yield "folds", [0.211903, 0.213697], values(folds, "d")


@demo("a curve of folds of cycles and where it turns", within=1e-4)
def abcb() -> Compared:
    _, folds = reaction()
    curve = folds[0].curve("al", (0.9, 1.5), options=few(22)).points
    yield "al where it turns", [0.982183, 1.26866], [float(curve.al.min()), float(curve.al.max())]


@demo("equilibria of a predator and its prey", within=1e-5)
def pp2() -> Compared:
    law = pk.Problem(
        {"f": "3*f*(1 - f) - f*s - q*(1 - exp(-5*f))", "s": "-s + 3*f*s"}, parameters={"q": 0.0}
    )
    alone = pk.continuation(law, "q", span=(0, 1)).special("BP")[0].switch()
    yield "fold", 0.832929, alone.special("LP")[0]["q"]
    both = [point for point in alone.special("BP") if point["q"] > 0.7][0]
    yield "branch point", 0.821904, both["q"]
    hopf = both.switch().special("H")[0]
    yield "Hopf", 0.671594, hopf["q"]
    cycles = hopf.switch()
    near = int(np.argmin(np.abs(cycles.points.period.values - 36)))
    law = law.replace(q=float(cycles.points.q[near]))
    more = {"orbit": cycles.orbit(near), "events": {"long": "period - 36"}, "stop": "long"}
    cycles = pk.continuation(law, "q", span=(0.6, 0.8), **more)
    yield "q at period 36", 0.70794090166, cycles.special("long")[0]["q"]


CHAIN = {
    "x": "x*(1 - x) - p4*x*y",
    "y": "-y/4 + p4*x*y - 3*y*z - p1*(1 - exp(-5*y))",
    "z": "-z/2 + 3*y*z",
}


@demo("Hopf points, cycles and their branch points")
def pp3() -> Compared:
    law = pk.Problem(CHAIN, parameters={"p1": 0.0, "p4": 4.0})
    point = pk.continuation(law, "p1", x0=[1, 0, 0], span=(0, 1)).special("BP")[0]
    yield "branch point", 0.75, point["p1"]
    hopf = sorted(point.switch().special("H"), key=lambda one: one["p1"])
    yield "Hopf", [0.106415, 0.459600], [one["p1"] for one in hopf]
    yield "BPC", 0.301234, hopf[1].switch(options=few(60)).special("BPC")[0]["p1"]


@demo("fold and Hopf points of the chain; curves of Hopf points")
def ppp() -> Compared:
    # Beyond its fold it goes to p1 = 0 and states without end.
    law = pk.Problem(CHAIN, parameters={"p1": 1e-3, "p4": 3.0})
    one = pk.continuation(law, "p1", x0=[1, 0, 0], span=(1e-3, 1)).special("BP")[0].switch()
    yield "fold", 0.564596, one.special("LP")[0]["p1"]
    hopf = one.special("H")
    yield "Hopf", [0.17902344797, 0.29235701684], values(hopf, "p1")
    zero_hopf = hopf[0].curve("p4", (2, 6)).special("ZH")
    yield "p4 at ZH", [3.34749, 5.43450], values(zero_hopf, "p4")
    law = law.replace(p4=4.9)
    rest = pk.continuation(law, "p1", x0=[0.1833, 1 / 6, 0.215], span=(1e-3, 1))
    generalized = rest.special("H")[0].curve("p4", (2, 6)).special("GH")
    yield "p4 at GH", [4.48973, 5.72873], values(generalized, "p4")


def enzyme() -> Any:
    law = pk.Problem(
        {"s": "110 - s - rh*s*a/D", "a": "al*(500 - a) - rh*s*a/D"},
        parameters={"rh": 2.021628, "al": 0.2},
        definitions={"D": "1 + s + s^2/10"},
    )
    return pk.continuation(law, "rh", x0=[45.55974, 177.7987], span=(2, 6)).special("H")


@demo("Hopf points and folds of their cycles")
def plp() -> Compared:
    hopf = enzyme()
    yield "Hopf", [3.49995, 4.65046], values(hopf, "rh")
    yield "folds", [2.75969, 5.00784], values(hopf[0].switch().special("LPC"), "rh")


@demo("a cycle by its phase")
def ph1() -> Compared:
    cycles = enzyme()[1].switch(options=few(80))
    near = int(np.argmin(np.abs(cycles.points.rh.values - 4.1)))
    law = cycles.problem.replace(rh=float(cycles.points.rh[near]))
    cycles = pk.continuation(law, "rh", orbit=cycles.orbit(near), span=(4, 4.5))
    yield "period at rh = 4", 6.73966, at(cycles, "rh", 4.0, "period")


@demo("a family of cycles at one parameter")
def phs() -> Compared:
    law = pk.Problem({"u": "-p*u - v", "v": "u*(1 - u)"}, parameters={"p": -1.0})
    hopf = pk.continuation(law, "p", x0=[0, 0], span=(-1, 1)).special("H")[0]
    yield "p along it", 0.0, float(np.abs(hopf.switch().points.p).max())


@demo("the same from the other side")
def vhb() -> Compared:
    law = pk.Problem({"u": "p*u - v", "v": "u*(1 - u)"}, parameters={"p": -1.0})
    hopf = pk.continuation(law, "p", x0=[0, 0], span=(-1, 1)).special("H")[0]
    yield "p along it", 0.0, float(np.abs(hopf.switch().points.p).max())


NEURON = {"x": "c*(x - x^3/3 + y - amp*cos(be*t))", "y": "-(x - a + b*y)/c"}
CELL = {"a": 0.0, "b": 0.8, "c": 3.0, "amp": 0.0, "be": 10.0}


@demo("a Hopf point, its curve and the relaxation cycle")
def fhn() -> Compared:
    law = pk.Problem({"x": "c*(x - x^3/3 + y)", "y": NEURON["y"]}, parameters=CELL)
    hopf = pk.continuation(law, "a", span=(0, 1)).special("H")[0]
    yield "Hopf", 0.422818, hopf["a"]
    yield "a at c = 10", 0.462671, abs(at(hopf.curve("c", (3, 10)), "c", 10.0, "a"))
    cycles = hopf.switch().points
    yield "period at a = 0", 9.53833, float(cycles.period[np.argmin(np.abs(cycles.a.values))])


@demo("tori of a forced system")
def ffn() -> Compared:
    driven = {"time": "t", "period": "2*pi/be"}
    for name, start, span, printed in (
        ("a", {"a": 0.6, "amp": 0.1}, (0, 1), 0.422945), ("amp", {"amp": 8.0}, (1, 10), 4.52337),
    ):  # fmt: skip
        law = pk.Problem(NEURON, parameters={**CELL, **start}, **driven)
        orbit = pk.periodic_orbit(law, [1.1, -0.6], settle=50)
        cycles = pk.continuation(law, name, orbit=orbit, span=span)
        yield f"torus in {name}", printed, cycles.special("TR")[0][name]


@demo("a forced relaxation oscillator", within=1e-5)
def frc() -> Compared:
    law = pk.Problem(
        {"v": "(v*(v - 1/2)*(1 - v) - w)/0.005", "w": "v - w - (1/2 + r*sin(100*t))"},
        parameters={"r": 0.0}, time="t", period=2 * np.pi / 100,
    )  # fmt: skip
    cycles = pk.continuation(law, "r", orbit=pk.periodic_orbit(law, [0.5, 0.0]), span=(0, 0.2))
    yield "largest v", 0.503634, float(cycles.points.v_max[-1])


CIRCUIT = {
    "x": "(-(be + nu)*x + be*y - 0.328578*x^3 + 0.933578*(y - x)^3)/0.6",
    "y": "be*x - (be + ga)*y - z - 0.933578*(y - x)^3",
    "z": "y",
}


@demo("branch points and tori of cycles")
def tor() -> Compared:
    law = pk.Problem(CIRCUIT, parameters={"nu": -0.9, "be": 0.5, "ga": -0.6})
    hopf = pk.continuation(law, "nu", span=(-0.9, -0.4)).special("H")[0]
    yield "Hopf", -0.589337, hopf["nu"]
    cycles = hopf.switch(options=few(40))
    yield "fold", -0.584335, cycles.special("LPC")[0]["nu"]
    point = cycles.special("BPC")[0]
    yield "branch point", -0.587029, point["nu"]
    other = point.switch(options=few(15))
    yield "torus", -0.591650, other.special("TR")[0]["nu"]
    yield "doubling", -0.614955, other.special("PD")[0]["nu"]


@demo("a smoothed circuit: Hopf point and doubling", within=2e-5)
def chu() -> Compared:
    law = pk.Problem(
        {"x": "al*(y - 2/7*x + 3/14*(A(x + 1) - A(x - 1)))", "y": "x - y + z", "z": "-14.3*y"},
        parameters={"al": 4.0},
        functions={"A(s)": "2*s*atan(10*s)/pi"},
    )
    hopf = pk.continuation(law, "al", x0=[1.4994, 0, -1.4994], span=(4, 10)).special("H")[0]
    yield "Hopf", 6.80443, hopf["al"]
    yield "doubling", 8.19600, hopf.switch(options=few(60)).special("PD")[0]["al"]


@demo("doublings of a cycle from data")
def lor() -> Compared:
    law = pk.Problem(
        {"x": "10*(y - x)", "y": "r*x - y - x*z", "z": "x*y - 8/3*z"}, parameters={"r": 280.0}
    )
    orbit = pk.periodic_orbit(law, [1, 1, 280], settle=20)
    doubling = pk.continuation(law, "r", orbit=orbit, span=(200, 281)).special("PD")[0]
    yield "doubling", 229.407, doubling["r"]
    yield "second", 218.210, doubling.switch(options=few(40)).special("PD")[0]["r"]


@demo("folds of cycles")
def ops() -> Compared:
    law = pk.Problem(
        {"x": "2*(-2*(x^3/3 - x) + (z - x)/4 - y)", "y": "x - p", "z": "(x - z)/4"},
        parameters={"p": 0.9},
    )
    hopf = pk.continuation(law, "p", x0=[0.9, 1.314, 0.9], span=(0.9, 1)).special("H")[0]
    folds = hopf.switch(options=few(60)).special("LPC")
    yield "folds", [0.921972, 0.928528], values(folds, "p")[:2]


@demo("branch points of cycles")
def tfc() -> Compared:
    law = pk.Problem(
        {
            "x": "1 - exp(x) - 5*exp(y)/(1 + 3*exp(x))",
            "y": "5*exp(x)/(1 + 3*exp(x)) - d1 - z/10/(1 + 2*exp(y))",
            "z": "z*(exp(y)/10/(1 + 2*exp(y)) - d2)",
        },
        parameters={"d1": 1.1083, "d2": 0.01},
    )
    rest = pk.continuation(law, "d1", x0=[-0.413, -1.599, 0], span=(0.5, 1.2))
    yield "Hopf", 0.833333, rest.special("H")[0]["d1"]
    cycles = rest.special("H")[0].switch(options=few(40))
    near = int(np.argmin(np.abs(cycles.points.d1.values - 0.75)))
    law = law.replace(d1=float(cycles.points.d1[near]))
    more = pk.continuation(law, "d1", orbit=cycles.orbit(near), span=(0.7, 0.8))
    end = int(np.argmin(np.abs(more.points.d1.values - 0.75)))
    more = pk.continuation(law.replace(d1=0.75), "d2", orbit=more.orbit(end), span=(0.005, 0.05))
    yield "BPC", 0.0155004, more.special("BPC")[0]["d2"]


@demo("a branch point of cycles; its curves")
def lcbp() -> Compared:
    law = pk.Problem(
        {"x": "-x*k - 2*pi*y", "y": "-y*k + 2*pi*x"},
        parameters={"p1": 1.0, "p2": 2.0, "p3": 0.0},
        definitions={"r": "sqrt(x^2 + y^2)", "k": "(r - p1)*(r - p2) + p3"},
    )
    orbit = pk.periodic_orbit(law, [1.0, 0.0], 1.0)
    cycles = pk.continuation(law, "p1", orbit=orbit, span=(0.5, 3))
    point = cycles.special("BPC")[0]
    yield "branch point", 2.0, point["p1"]
    for more, spans in (("p2", (0.5, 3)), (["p2", "p3"], [(0.5, 3), (-1, 1)])):
        curve = point.curve(more, spans).points
        yield "p1 less p2 along its curve", 0.0, float(abs(curve.p1 - curve.p2).max())


@demo("a bursting cell: Hopf points and folds", within=1e-5)
def pla() -> Compared:
    law = pk.Problem(
        {
            "V": "(g*S^3*y + x/100)*(30 - V) - (0.3*K^4 + 0.03*c/(0.5 + c))*(75 + V)"
            " - 0.003*(40 + V)",
            "x": "(1/(exp(-0.15*(50 + V)) + 1) - x)/235",
            "K": "(an - K*(an + bn))/12.5",
            "y": "(ah - y*(ah + bh))/12.5",
            "c": "0.0003*(0.0085*x*(140 - V) - c)",
        },
        parameters={"g": 50.0},
        definitions={
            "W": "(127*V + 8265)/105", "am": "(50 - W)/10/(exp((50 - W)/10) - 1)",
            "bm": "4*exp((25 - W)/18)", "S": "am/(am + bm)", "ah": "0.07*exp((25 - W)/20)",
            "bh": "1/(exp((55 - W)/10) + 1)", "an": "(55 - W)/100/(exp((55 - W)/10) - 1)",
            "bn": "exp((45 - W)/80)/8",
        },
    )  # fmt: skip
    start = [-2.3296, 0.999216, 0.737331, 0.00613595, 1.20885]
    rest = pk.continuation(law, "g", x0=start, span=(-120, 50))
    yield "Hopf", [-103.779, 15.2265], values(rest.special("H"), "g")
    yield "folds", [2.58654, 47.4501], values(rest.special("LP"), "g")


@demo("travelling waves as equilibria and cycles")
def wav() -> Compared:
    rates = {"p3": 500.0}
    named = {"R": "v/(3.4 + v)*u/(1 + u + 0.023*u^2)"}
    law = {"u": "-3*(210*R - 145 + u)", "v": "-3*(210*R - (p3 - v)/5)"}
    rest = pk.continuation(
        pk.Problem(law, parameters=rates, definitions=named),
        "p3", x0=[62.77, 88.83], span=(500, 800),
    )  # fmt: skip
    yield "folds", [630.891, 666.144], values(rest.special("LP"), "p3")
    yield "Hopf", 662.202, rest.special("H")[0]["p3"]
    law = {
        "u": "a", "v": "b",
        "a": "-0.05*a + 3*(210*R - 145 + u)", "b": "(-0.05*b + 3*(210*R - (p3 - v)/5))/5",
    }  # fmt: skip
    waves = pk.continuation(
        pk.Problem(law, parameters=rates, definitions=named),
        "p3", x0=[62.77, 88.83, 0, 0], span=(500, 800),
    )  # fmt: skip
    yield "Hopf of waves", 635.591, waves.special("H")[0]["p3"]


def brusselator(D: Any, edge: Any, longest: float) -> list[float]:
    """Lengths at Hopf points, by second derivatives inside (0, 1) and their part of the edges."""
    n = len(edge)

    def f(x: Any, L: float) -> Any:
        u, v = x[:n], x[n:]
        u_s = -6.45 * u + u * u * v + 2 + 0.008 / L**2 * (D @ u + edge * 2)
        return np.concatenate((u_s, 5.45 * u - u * u * v + 0.004 / L**2 * (D @ v + edge * 2.725)))

    law = pk.Problem(f, [f"{name}{i}" for name in "uv" for i in range(n)], {"L": 0.4})
    rest = pk.continuation(law, "L", x0=[2.0] * n + [2.725] * n, span=(0.4, longest))
    return values(rest.special("H"), "L")


@demo("the Brusselator in finite differences of fourth order, as a Python function", within=2e-4)
def brf() -> Compared:
    one = np.eye(5)
    side = np.eye(5, k=1) + np.eye(5, k=-1)
    inverse = np.linalg.inv((10 * one + side) / 12)
    D, edge = inverse @ (side - 2 * one) * 36, (inverse[:, 0] + inverse[:, -1]) * 36
    yield "Hopf", [0.512990, 1.02338, 1.51789, 1.95959], brusselator(D, edge, 2.05)


@demo("the Brusselator by Chebyshev collocation, as a Python function", within=1e-5)
def brc() -> Compared:
    inner = (1 - np.cos(np.pi * (2 * np.arange(6) + 1) / 12)) / 2
    x, k = np.array([0, *inner, 1])[:, None], np.arange(8)
    D = (k * (k - 1) * x ** np.maximum(k - 2, 0) @ np.linalg.inv(x**k))[1:-1]
    yield "Hopf", [0.513019, 1.02514], brusselator(D[:, 1:-1], D[:, 0] + D[:, -1], 1.1)


@demo("doublings and folds of cycles; connections between them, which are refused")
def c2c() -> Compared:
    law = pk.Problem(
        {
            "x": "x*(1 - x) - 5*x*y/(1 + 3*x)",
            "y": "5*x*y/(1 + 3*x) - d*y - y*z/10/(1 + 2*y)",
            "z": "y*z/10/(1 + 2*y) - z/80",
        },
        parameters={"d": 0.5},
    )
    hopf = pk.continuation(law, "d", x0=[0.7416, 0.16667, 8.6644], span=(0.2, 0.6)).special("H")[0]
    yield "Hopf", 0.512270, hopf["d"]
    cycles = hopf.switch()
    yield "doublings", [0.216681, 0.428911], values(cycles.special("PD"), "d")
    yield "fold", 0.208045, values(cycles.special("LPC"), "d")[0]


@demo("planar periodic orbits of three bodies around L1")
def r3b() -> Compared:
    law = pk.Problem(
        {
            "x": "u", "y": "v",
            "u": "2*v + x - (1 - m)*(x + m)/d^3 - m*(x - 1 + m)/r^3 + l*u",
            "v": "-2*u + y - (1 - m)*y/d^3 - m*y/r^3 + l*v",
        },
        parameters={"l": 0.0, "m": 0.0630047},
        definitions={"d": "sqrt((x + m)^2 + y^2)", "r": "sqrt((x - 1 + m)^2 + y^2)"},
    )  # fmt: skip
    hopf = pk.continuation(law, "l", x0=[0.7, 0, 0, 0], span=(-0.1, 0.1)).special("H")[0]
    yield "x of L1", 0.684812, hopf["x"]
    cycles = hopf.switch(options=few(15))
    yield "period there", 2.46895, 2 * np.pi / hopf.normal_form["omega"]
    yield "period of a larger one", 3.84080, at(cycles, "x_max", 0.869307, "period")


@demo("rotations of coupled pendula, as an angle and a difference", within=1e-5)
def pen() -> Compared:
    law = pk.Problem(
        {
            "f": "v", "d": "w", "v": "-v/10 - sin(f) + I + 0.175*d",
            "w": "-w/10 - sin(f + d) + sin(f) - 0.35*d",
        },
        parameters={"I": 0.2}, periods={"f": 2 * np.pi},
    )  # fmt: skip
    orbit = pk.periodic_orbit(law, [0.0, 0.0, 2.0, 0.0])
    cycles = pk.continuation(law, "I", orbit=orbit, span=(0.17, 0.41))
    yield "doubling", 0.179163, cycles.special("PD")[0]["I"]


# ---- motions


@demo("a motion in time, there by Euler's method", within=2e-5)
def ivp() -> Compared:
    law = pk.Problem({"u": "3*u*(1 - u) - u*v", "v": "-v + 3*u*v"}, start={"u": 0.3, "v": 0.3})
    motion = pk.flow(law, t=[0, 22.9254])
    yield "end", [0.333332, 2.00001], [float(motion.motion_u[-1]), float(motion.motion_v[-1])]


# ---- boundary value problems

BRATU = {"u": "v", "v": "-p*exp(u)"}


def bratu() -> pk.BoundaryProblem:
    return pk.BoundaryProblem(BRATU, ["u(0)", "u(1)"], parameters={"p": 0.0})


@demo("Bratu's equation")
def exp() -> Compared:
    branch = pk.continuation(bratu(), "p", span=(0, 4), stop="fold")
    yield "fold", 3.51383, branch.special("LP")[0]["p"]


@demo("Bratu's equation, with quantities recorded")
def pvl() -> Compared:
    branch = pk.continuation(bratu(), "p", span=(0, 4), events={"five": "v_max - 5"}, stop="five")
    yield "p at v(0) = 5", 3.37883, branch.special("five")[0]["p"]


@demo("five copies of Bratu's equation", within=1e-5)
def tim() -> Compared:
    law, ends = {}, []
    for i in range(5):
        law |= {f"u{i}": f"v{i}", f"v{i}": f"-p*exp(u{i})"}
        ends += [f"u{i}(0)", f"u{i}(1)"]
    problem = pk.BoundaryProblem(law, ends, parameters={"p": 0.0})
    branch = pk.continuation(problem, "p", span=(0, 0.0743505))
    yield "largest u", 9.36661e-3, float(branch.points.u0_max[-1])


@demo("Bratu's equation with complex u, as four equations")
def ezp() -> Compared:
    law = {"u": "v", "w": "z", "v": "-p*exp(u)*cos(w)", "z": "-p*exp(u)*sin(w)"}
    problem = pk.BoundaryProblem(law, ["u(0)", "u(1)", "w(0)", "w(1)"], parameters={"p": 0.0})
    branch = pk.continuation(problem, "p", span=(0, 4), stop="branch_point")
    yield "branch point", 3.51383, branch.special("BP")[0]["p"]


@demo("one condition and one integral")
def int_() -> Compared:
    problem = pk.BoundaryProblem(
        BRATU, ["u(0) - u(1) - gap"], ["u - mean"], {"p": 0.0, "gap": 0.0, "mean": 0.0}
    )
    branch = pk.continuation(problem, "p", span=(0, 14), stop="fold")
    yield "fold", 11.9238, branch.special("LP")[0]["p"]


@demo("a nonlinear eigenvalue problem")
def bvp() -> Compared:
    problem = pk.BoundaryProblem(
        {"u": "v", "v": "-(p*pi)^2*u + u^2"}, ["u(0)", "u(1)"], ["u - mean"],
        {"p": 0.5, "mean": 0.0},
    )  # fmt: skip
    three = {"three": "mean - 3"}
    branch = pk.continuation(problem, ("p", "mean"), span=(0.5, 4.5), events=three)
    yield "branch points", [1, 2, 3, 4], values(branch.special("BP"), "p")
    one = branch.special("BP")[0].switch(options=few(60))
    yield "p at a mean of 3", 1.1842021393, one.special("three")[0]["p"]


@demo("a linear eigenvalue problem")
def lin() -> Compared:
    problem = pk.BoundaryProblem(
        {"u": "v", "v": "-(p*pi)^2*u"}, ["u(0)", "u(1)"], ["u^2 - size"], {"p": 0.5, "size": 0.0}
    )
    branch = pk.continuation(problem, ("p", "size"), span=(0.5, 3.5))
    yield "branch points", [1, 2, 3], values(branch.special("BP"), "p")


@demo("spurious solutions of a coarse mesh, which are none here", within=3e-3)
def ext() -> Compared:
    problem = pk.BoundaryProblem(
        {"u": "v", "v": "-(p*pi)^2*sin(u + u^2 + u^3)"}, ["u(0)", "u(1)"], parameters={"p": 0.5}
    )
    branch = pk.continuation(problem, "p", span=(0.5, 3.5))
    yield "branch points", [0.999969, 2.00102, 3.00746], values(branch.special("BP"), "p")


@demo("equations that know x")
def non() -> Compared:
    problem = pk.BoundaryProblem(
        {"u": "v", "v": "-p*exp(x^3*u)", "x": "1"}, ["u(0)", "u(1)", "x(0)"], parameters={"p": 0.0}
    )
    branch = pk.continuation(problem, "p", x0=lambda s: (0, 0, s), span=(0, 16), stop="fold")
    yield "fold", 14.0745, branch.special("LP")[0]["p"]


@demo("swirling flow on a half-line, cut at 500")
def kar() -> Compared:
    law = {
        "a": "500*b", "b": "500*c", "c": "500*(-2*g*d + b^2 - 2*a*c - d^2)",
        "d": "500*e", "e": "500*(2*g*b + 2*b*d - 2*a*e)",
    }  # fmt: skip
    ends = [
        "a(0)", "b(0)", "d(0) - 1 + g", "a(1) - f", "(f + P)*b(1) + c(1) - g*d(1)/P",
        "g*b(1)/P + (f + P)*d(1) + e(1)",
    ]  # fmt: skip
    named = {"C": "sqrt(f^4 + 4*g^2)", "P": "sqrt((C + f^2)/2)"}
    problem = pk.BoundaryProblem(law, ends, parameters={"g": 1.0, "f": 0.0}, definitions=named)
    branch = pk.continuation(problem, ("g", "f"), span=(-0.3, 1.0), options=few(75))
    yield "folds", [-0.16053876128, 0.07452563027], values(branch.special("LP"), "g")


@demo("layers of a singularly perturbed problem")
def spb() -> Compared:
    problem = pk.BoundaryProblem(
        {"u": "v", "v": "l*(u*(u^2 - 1)*v + u)/e"}, ["u(0) - 3/2", "u(1) - 6/5"],
        parameters={"l": 0.0, "e": 0.1},
    )  # fmt: skip
    one = pk.continuation(problem, "l", x0=lambda s: (1.5 - 0.3 * s, -0.3), span=(0, 1))
    yield "largest v", 3.39457, float(one.points.v_max[-1])
    two = pk.continuation(problem.replace(l=1.0), "e", x0=one.orbit(-1), span=(0.001, 0.1))
    yield "at e = .001", 67.7491, at(two, "e", 0.001, "v_max")


@demo("buckling of a beam")
def nep() -> Compared:
    problem = pk.BoundaryProblem(
        {"u": "v", "v": "-q*u", "w": "-v^2/2 - q"}, ["u(0)", "u(1)", "w(0) - p", "w(1) + p"],
        parameters={"p": 2.0, "q": 4.0},
    )  # fmt: skip
    branch = pk.continuation(problem, ("p", "q"), x0=lambda s: (0, 0, 2 - 4 * s), span=(1, 6))
    point = branch.special("BP")[0]
    yield "branch point", 4.93480, point["p"]
    yield "largest v at p = 6", 2.9191749512, float(point.switch().points.v_max[-1])


@demo("a flame in a slab")
def sspg() -> Compared:
    problem = pk.BoundaryProblem(
        {"u": "-v", "v": "-u*v - m*v"}, ["u(1)", "4*u(0) - v(0)"], parameters={"m": 1.0}
    )
    branch = pk.continuation(problem, "m", span=(1, 5))
    yield "branch point", 3.92069, branch.special("BP")[0]["m"]


@demo("a stationary state of a diffusion equation")
def pd1() -> Compared:
    problem = pk.BoundaryProblem(
        {"u": "v", "v": "-1000*p*u*(1 - u)"}, ["u(0)", "u(1)"], parameters={"p": 1.0}
    )
    s = np.linspace(0, 1, 401)  # AUTO comes from a motion in time; this is one layer at each end
    z = np.sqrt(1000) / 2 * np.minimum(s, 1 - s) + np.arccosh(np.sqrt(1.5))
    u = 1 - 1.5 / np.cosh(z) ** 2
    branch = pk.continuation(problem, "p", x0=np.stack([u, np.gradient(u, s)], 1), span=(1, 44))
    orbit = branch.orbit(branch.points.sizes["point"] - 1)
    yield "largest u", 1.0, float(orbit.u.max())
    square = CubicSpline(orbit.time, orbit.u**2).integrate(0, 1)
    t, k = np.sqrt(1 / 3), np.sqrt(44000)  # and as these layers have it
    exact = 1 - (12 * (1 - t) - 9 * (2 / 3 - t + t**3 / 3)) / k
    yield "norm of u", np.sqrt(exact), float(np.sqrt(square))
    yield "norm of u at p = 44", 0.991164, float(np.sqrt(square))


@demo("stationary states of two diffusing species", within=2e-4)
def pd2() -> Compared:
    problem = pk.BoundaryProblem(
        {"u": "a", "v": "b", "a": "-p*u*(1 - u) + u*v", "b": "v - u*v"},
        ["u(0)", "u(1)", "v(0) - 1", "v(1) - 1"], parameters={"p": 12.0},
    )  # fmt: skip
    s = np.linspace(0, 1, 21) * np.pi
    guess = np.stack([0.12 * np.sin(s), 1 + 0 * s, 0.12 * np.pi * np.cos(s), 0 * s], axis=1)
    branch = pk.continuation(problem, "p", x0=guess, span=(7.8, 12.1))
    yield "branch point", 10.7712, branch.special("BP")[0]["p"]
    yield "mean of u", -0.278185, at(branch, "p", 7.82250, "u_mean")


@demo("an unstable manifold by motions from a circle")
def um2() -> Compared:
    problem = pk.BoundaryProblem(
        {"x": "T*(e*x - y^3)", "y": "T*(y + x^3)"},
        ["x(0)", "y(0) - 1/10", "sqrt(x(1)^2 + y(1)^2) - r"],
        parameters={"r": 0.1, "T": 1e-4, "e": 0.5},
    )  # fmt: skip
    one = pk.continuation(problem, ("r", "T"), x0=[0.0, 0.1], span=(0.09, 0.6))
    yield "time to r = .6", 1.78222, float(one.points["T"][-1])


@demo("an unstable manifold in three dimensions")
def um3() -> Compared:
    problem = pk.BoundaryProblem(
        {"x": "T*(x/2 - y^3 + z^3)", "y": "T*(y + x^3)", "z": "T*(x^2 - z)"},
        ["x(0)", "y(0) - 3/100", "z(0)", "sqrt(x(1)^2 + y(1)^2 + z(1)^2) - r"],
        parameters={"r": 0.03, "T": 1e-4},
    )
    one = pk.continuation(problem, ("r", "T"), x0=[0.0, 0.03, 0.0], span=(0.029, 1.0))
    yield "time to r = 1", 3.45109, float(one.points["T"][-1])


@demo("a stable manifold of Lorenz, by arclength")
def man() -> Compared:
    f = ("10*(y - x)", "28*x - y - x*z", "x*y - 8/3*z")
    start = (-0.07915388742889, 0.10153641780224, 1.51690496832182)
    length = "-T*sqrt(" + " + ".join(f"({one})^2" for one in f) + ") - long"
    problem = pk.BoundaryProblem(
        {name: f"T*({one})" for name, one in zip("xyz", f, strict=True)},
        [f"{name}(0) - ({one!r})" for name, one in zip("xyz", start, strict=True)], [length],
        {"long": 1e-3, "T": -1e-3},
    )  # fmt: skip
    orbit = pk.continuation(problem, ("long", "T"), x0=start, span=(1e-3, 10.0)).orbit(-1)
    yield "end", [-6.29807, 7.54578], [float(orbit.x[-1]), float(orbit.y[-1])]


@demo("the orbit that comes from a node to a saddle, by its time")
def fsh() -> Compared:
    problem = pk.BoundaryProblem(
        {"u": "T*v", "v": "T*(11*v - u*(1 - u))"},
        ["u(1) - 1 + e", "v(1) + e*(11 - sqrt(125))/2"],
        parameters={"T": 0.01, "e": 0.000995959314},
    )
    one = pk.continuation(problem, "T", x0=[0.999, 8.98e-5], span=(0.01, 100))
    yield "least u at T = 100", 0.105009, float(one.points.u_min[-1])


@demo("the least cost of a boundary problem over p, as folds of the cost", within=5e-6)
def obv() -> Compared:
    cost = "(u - 1)^2 + (p^2 + q^2 + r^2)/10 - cost"
    problem = pk.BoundaryProblem(
        {"u": "v", "v": "-p*exp(u + q*u^2 + r*u^4)"}, ["u(0)", "u(1)"], [cost],
        {"cost": 1.0, "p": 0.0, "q": 0.0, "r": 0.0},
    )  # fmt: skip
    branch = pk.continuation(problem, ("cost", "p"), span=(0.3, 1.6))
    extremes = sorted(branch.special("LP"), key=lambda one: one["cost"])
    yield "p", [0.924364, 3.05893, 3.50591], [one["p"] for one in extremes]
    yield "cost", [0.923446, 1.32627, 1.42526], [one["cost"] for one in extremes]


# ---- connecting orbits; tests of connections have their digits


@demo("a front between saddles")
def nag() -> Compared:
    law = pk.Problem({"u": "v", "v": "c*v - u*(1 - u)*(u - 1/4)"}, parameters={"c": 0.3})
    front = pk.connection(law, ([0, 0], [1, 0]), free="c")
    yield "c at a = 1/4", 0.353553, float(front.points.c[0])


def loop_at(law: pk.Problem, free: str) -> float:
    """The parameter at which an orbit leads from the origin of space back to it."""
    return float(pk.connection(law, ([0, 0, 0], [0, 0, 0]), free=free).points[free][0])


@demo("a loop of Sandstede's system")
def san() -> Compared:
    law = pk.Problem(
        {
            "x": "y + (m - z)*x*(2 - 3*x)",
            "y": "x - 3/2*x^2 - 2*y*(m - z)",
            "z": "-2*z + x^2*(1 - x) - y^2",
        },
        parameters={"m": 0.001},
    )
    yield "m", 0.0, loop_at(law, "m")


@demo("Hopf point, cycles, the loop where they end and where it flips")
def sib() -> Compared:
    law = pk.Problem(
        {
            "x": "a*x + b*y - a*x^2 - al*z*x*(2 - 3*x)",
            "y": "b*x + a*y - 3/2*x*(b*x + a*y) + 2*al*z*y",
            "z": "c*z + mu*x + 3*x*z + al*(x^2*(1 - x) - y^2)",
        },
        parameters={"a": 0.375, "b": 0.625, "c": -2.5, "al": 0.2, "mu": 0.0},
    )
    hopf = pk.continuation(law, "al", x0=[0.66, -0.13, 0.05], span=(0.2, 0.4)).special("H")[0]
    yield "Hopf", 0.31842686995, hopf["al"]
    law = law.replace(al=hopf["al"])
    rest = pk.continuation(law, "mu", x0=hopf.x, span=(-0.1, 0.1))
    cycles = rest.special("H")[0].switch()
    (end,) = [stop for stop in cycles.stops if stop.reason == "homoclinic"]
    loop = end.connection()
    yield "mu of the loop", 0.0, float(loop.points.mu[0])
    law = law.replace(c=-2.0, al=0.1)
    loop = pk.connection(law, loop.orbit(0), free="mu").curve("al", (0.05, 0.15))
    yield "flip", 0.0711774, loop.special("IFS")[0]["al"]


@demo("a circuit: a loop at a saddle-focus")
def cir() -> Compared:
    law = pk.Problem(CIRCUIT, parameters={"nu": -0.7213, "be": 0.6, "ga": 0.0})
    yield "nu", -0.721309, loop_at(law, "nu")


if __name__ == "__main__":
    warnings.simplefilter("ignore")
    for name in sys.argv[1:] or sorted(DEMOS):
        one = DEMOS[name]
        what, printed, found = list(one.run())[-1]
        a, b = np.ravel(printed)[-1], np.ravel(found)[-1]
        said = (
            "yes, `BoundaryProblem`"
            if any(word in inspect.getsource(one.run) for word in ("Boundary", "bratu("))
            else "yes"
        )
        own = f"{b:.10g}" if abs(b) > 1e-9 else f"{b:.0e}"
        print(
            f"| {name} | {one.asks} | {said} | {one.lines} | {what} {a:.6g} | {own} |", flush=True
        )
