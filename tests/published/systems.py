"""Systems whose bifurcations are known, each written once, as strings.

From the strings come the symbolic system, the plain Python function and the compiled one. A
system also carries its equilibria as explicit curves: the state and the parameter as functions of
one variable t, solved from the equations by hand. ``published.reference`` finds the special
points on these curves in 40 digits; no continuation takes part.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

#: What the special points of a curve are called.
FOLD, BRANCH, HOPF, NEUTRAL = "fold", "branch_point", "hopf", "neutral_saddle"


@dataclass(frozen=True)
class Curve:
    """Equilibria as functions of t: the state, the parameter, and the range of t.

    ``inner`` are quantities in terms of t that the state and the parameter use.
    """

    state: tuple[str, ...]
    parameter: str
    low: float
    high: float
    inner: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class System:
    """One system, the curve of equilibria that is followed, and what was published about it.

    x0 is a guess of the equilibrium at the start, where the parameters have their own values.
    ``published`` gives the parameter at the special points, as printed or in closed form.
    """

    name: str
    source: str
    state: tuple[str, ...]
    equations: tuple[str, ...]
    parameters: Mapping[str, float]
    parameter: str
    x0: tuple[float, ...]
    span: tuple[float, float]
    curves: tuple[Curve, ...]
    published: Mapping[str, tuple[float, ...]] = field(default_factory=dict)
    digits: float = 1e-9  # to which it was printed
    bounds: Mapping[str, tuple[float, float]] = field(default_factory=dict)

    def python(self, namespace: Any = math, wrap: str = "[{}]") -> Callable[..., Any]:
        """Return f(state, **parameters) as a user writes it, with math or numpy."""
        return self._function(namespace, wrap)

    def compiled(self) -> Callable[..., Any]:
        """Return the same function compiled by numba."""
        import numba

        return numba.njit(self._function(np, "np.array([{}])"))

    def _function(self, namespace: Any, wrap: str) -> Callable[..., Any]:
        unpack = "".join(f"    {name} = state[{i}]\n" for i, name in enumerate(self.state))
        body = wrap.format(", ".join(self.equations))
        arguments = ", ".join(["state", *self.parameters])
        code = f"def f({arguments}):\n{unpack}    return {body}\n"
        scope = {name: getattr(namespace, name) for name in ("exp", "log", "sin", "cos", "tanh")}
        scope |= {"cosh": namespace.cosh, "sqrt": namespace.sqrt, "np": np}
        exec(compile(code, f"<{self.name}>", "exec"), scope)
        function: Callable[..., Any] = scope["f"]
        return function


KUZNETSOV = "Kuznetsov, Elements of Applied Bifurcation Theory, 3rd edition, Springer 2004"

SYSTEMS: dict[str, System] = {
    system.name: system
    for system in (
        # --- the published values of the text --------------------------------------------------
        System(
            name="cusp",
            source=f"{KUZNETSOV}, 8.2: folds at mu = -+2 (l/3)^(3/2)",
            state=("x",),
            equations=("mu + l*x - x**3",),
            parameters={"mu": -1.0, "l": 1.0},
            parameter="mu",
            x0=(-1.3,),
            span=(-1.5, 1.5),
            curves=(Curve(("t",), "t**3 - l*t", -3.0, 3.0),),
            published={FOLD: (-2 / (3 * math.sqrt(3)), 2 / (3 * math.sqrt(3)))},
        ),
        System(
            name="pitchfork surface",
            source="k + x (l - x^2) = 0, double roots by hand: k = -+2 (l/3)^(3/2)",
            state=("x",),
            equations=("k + x*(l - x**2)",),
            parameters={"k": -1.0, "l": 0.7},
            parameter="k",
            x0=(-1.2,),
            span=(-2.0, 2.0),
            curves=(Curve(("t",), "-t*(l - t**2)", -3.0, 3.0),),
            published={FOLD: (-2 * (0.7 / 3) ** 1.5, 2 * (0.7 / 3) ** 1.5)},
        ),
        System(
            name="A -> B reaction",
            source="AUTO-07p, demo ab (Uppal, Ray, Poore, Chem. Eng. Sci. 29, 1974, 967-985)",
            state=("u1", "u2"),
            equations=(
                "-u1 + p1*(1 - u1)*exp(u2)",
                "-u2 + p1*p2*(1 - u1)*exp(u2) - p3*u2",
            ),
            parameters={"p1": 0.0, "p2": 14.0, "p3": 2.0},
            parameter="p1",
            x0=(0.0, 0.0),
            span=(0.0, 0.15),
            curves=(
                Curve(
                    ("t", "p2*t/(1 + p3)"),
                    "t*exp(-p2*t/(1 + p3))/(1 - t)",
                    0.0,
                    0.999,
                ),
            ),
            published={FOLD: (0.0889318462, 0.1057389783), HOPF: (0.1309000448,)},
            digits=6e-11,
        ),
        System(
            name="Lorenz, at rest",
            source="Lorenz, J. Atmos. Sci. 20, 1963, 130-141: rho = 1; neutral saddle by hand",
            state=("x", "y", "z"),
            equations=("sigma*(y - x)", "x*(rho - z) - y", "x*y - beta*z"),
            parameters={"rho": 0.0, "sigma": 10.0, "beta": 8 / 3},
            parameter="rho",
            x0=(0.0, 0.0, 0.0),
            span=(0.0, 30.0),
            curves=(Curve(("0*t", "0*t", "0*t"), "t", 0.0, 30.0),),
            # the positive eigenvalue of the block in (x, y) is beta: no Hopf point
            published={BRANCH: (1.0,), NEUTRAL: (209 / 45,)},
        ),
        System(
            name="Lorenz, convection",
            source="Lorenz, J. Atmos. Sci. 20, 1963, 130-141: sigma (sigma+beta+3)/(sigma-beta-1)",
            state=("x", "y", "z"),
            equations=("sigma*(y - x)", "x*(rho - z) - y", "x*y - beta*z"),
            parameters={"rho": 10.0, "sigma": 10.0, "beta": 8 / 3},
            parameter="rho",
            x0=(4.9, 4.9, 9.0),
            span=(-1.0, 30.0),
            curves=(Curve(("t", "t", "t**2/beta"), "1 + t**2/beta", -9.0, 9.0),),
            # through the pitchfork to the mirror image: one Hopf point on each half
            published={BRANCH: (1.0,), HOPF: (470 / 19, 470 / 19)},
        ),
        System(
            name="Brusselator",
            source="Lefever, Nicolis, J. Theor. Biol. 30, 1971, 267-284: B = 1 + A^2",
            state=("x", "y"),
            equations=("A - (B + 1)*x + x**2*y", "B*x - x**2*y"),
            parameters={"B": 1.0, "A": 1.0},
            parameter="B",
            x0=(1.0, 1.0),
            span=(0.5, 6.0),
            curves=(Curve(("A + 0*t", "t/A"), "t", 0.5, 6.0),),
            published={HOPF: (2.0,)},
        ),
        System(
            name="neural mass",
            source="Tsodyks, Pawelzik, Markram, Neural Comput. 10, 1998, 821-835; "
            "Cortes et al., PNAS 110, 2013, 16610-16615; values: BifurcationKit.jl's tutorial",
            state=("E", "x", "u"),
            equations=(
                "(-E + al*log(1 + exp((J*u*x*E + E0)/al)))/tau",
                "(1 - x)/tD - u*x*E",
                "U0*E*(1 - u) - (u - U0)/tF",
            ),
            parameters={
                "E0": -2.0,
                "tau": 0.013,
                "J": 3.07,
                "tD": 0.2,
                "U0": 0.3,
                "tF": 1.5,
                "al": 1.5,
            },
            parameter="E0",
            x0=(0.238616, 0.982747, 0.367876),
            span=(-10.0, -0.9),
            curves=(
                Curve(
                    ("t", "x", "u"),
                    "al*log(exp(t/al) - 1) - J*u*x*t",
                    1e-3,
                    30.0,
                    {"u": "(U0*t + U0/tF)/(U0*t + 1/tF)", "x": "1/(1 + tD*u*t)"},
                ),
            ),
            published={
                FOLD: (-1.8652239103, -1.4630273255),
                # printed with an error of 5e-10
                HOPF: (-1.8501245949, -1.1510593974),
            },
            digits=6e-10,
        ),
        *(
            System(
                name=f"CO oxidation, k = {k}",
                source="Bykov, Yablonskii, Kim, Dokl. Akad. Nauk SSSR 242, 1978, 637-639; "
                f"{KUZNETSOV}, 9; values: BifurcationKit.jl's tutorial",
                state=("x", "y", "s"),
                equations=(
                    "2*q1*(1 - x - y - s)**2 - 2*q5*x**2 - q3*x*y",
                    "q2*(1 - x - y - s) - q6*y - q3*x*y",
                    "q4*((1 - x - y - s) - k*s)",
                ),
                parameters={
                    "q2": q2,
                    "q1": 2.5,
                    "q3": 10.0,
                    "q4": 0.0675,
                    "q5": 1.0,
                    "q6": 0.1,
                    "k": k,
                },
                parameter="q2",
                x0=x0,
                span=(0.5, 2.0),
                # x = t z; z from x + y + z + s = 1 with s = z/k and the first equation
                curves=(
                    Curve(
                        ("t*z", "w*z", "z/k"),
                        "w*(q6 + q3*t*z)",
                        1e-3,
                        math.sqrt(2.5) - 1e-3,
                        {"w": "(2*q1/t - 2*q5*t)/q3", "z": "1/(t + w + 1 + 1/k)"},
                    ),
                ),
                published=published,
                digits=digits,
            )
            for k, q2, x0, published, digits in (
                (
                    0.4,
                    0.6,
                    (0.07, 0.2, 0.5),
                    {
                        FOLD: (1.0420485054, 1.0522002879),
                        HOPF: (1.0409915695, 1.0515574625),
                    },
                    6e-11,
                ),
                (
                    1.0,
                    1.0,
                    (0.29, 0.1, 0.3),
                    {FOLD: (1.2011147837, 1.4284928031), NEUTRAL: (1.202834, 1.428482)},
                    6e-7,
                ),
            )
        ),
        System(
            name="adaptive control",
            source=f"{KUZNETSOV}, 5.4 (feedback control of Lur'e type): al = 1/be",
            state=("x", "y", "z"),
            equations=("y", "z", "-al*z - be*y - x + x**2"),
            parameters={"al": 2.0, "be": 1.0},
            parameter="al",
            x0=(0.0, 0.0, 0.0),
            span=(0.2, 3.0),
            curves=(Curve(("0*t", "0*t", "0*t"), "t", 0.2, 3.0),),
            published={HOPF: (1.0,)},
        ),
        System(
            name="two cells of Bratu, equal",
            source="by hand: a = t e^-t; folds at t = 1, the cells part at t = 3",
            state=("x", "y"),
            equations=("-2*x + y + a*exp(x)", "x - 2*y + a*exp(y)"),
            parameters={"a": 0.0},
            parameter="a",
            x0=(0.0, 0.0),
            span=(0.0, 1.0),
            curves=(Curve(("t", "t"), "t*exp(-t)", 0.0, 12.0),),
            published={FOLD: (math.exp(-1),), BRANCH: (3 * math.exp(-3),)},
            bounds={"x": (-1.0, 11.5)},
        ),
        System(
            name="two cells of Bratu, unequal",
            source="by hand, in the difference t of the cells; the cells meet at a = 3 e^-3",
            state=("x", "y"),
            equations=("-2*x + y + a*exp(x)", "x - 2*y + a*exp(y)"),
            parameters={"a": 0.1},
            parameter="a",
            x0=(3.9, 2.75),
            span=(0.01, 1.0),
            curves=(
                Curve(
                    ("y + t", "y"),
                    "(y - t)*exp(-y)",
                    -8.0,
                    8.0,
                    {"y": "t*(1 + 2*exp(-t))/(1 - exp(-t))"},
                ),
            ),
            bounds={"x": (-1.0, 10.0), "y": (-1.0, 10.0)},
        ),
        # --- more ------------------------------------------------------------------------------
        System(
            name="fold",
            source="by hand",
            state=("x",),
            equations=("mu - x**2",),
            parameters={"mu": 1.0},
            parameter="mu",
            x0=(1.0,),
            span=(-1.0, 2.0),
            curves=(Curve(("t",), "t**2", -2.0, 2.0),),
            published={FOLD: (0.0,)},
        ),
        System(
            name="transcritical",
            source="by hand",
            state=("x",),
            equations=("mu*x - x**2",),
            parameters={"mu": -1.0},
            parameter="mu",
            x0=(0.0,),
            span=(-1.0, 2.0),
            curves=(Curve(("0*t",), "t", -1.0, 2.0),),
            published={BRANCH: (0.0,)},
        ),
        System(
            name="transcritical, other branch",
            source="by hand",
            state=("x",),
            equations=("mu*x - x**2",),
            parameters={"mu": -1.0},
            parameter="mu",
            x0=(-1.0,),
            span=(-1.5, 2.0),
            curves=(Curve(("t",), "t", -1.5, 2.0),),
            published={BRANCH: (0.0,)},
        ),
        System(
            name="pitchfork",
            source="by hand",
            state=("x",),
            equations=("mu*x - x**3",),
            parameters={"mu": -1.0},
            parameter="mu",
            x0=(0.0,),
            span=(-1.0, 2.0),
            curves=(Curve(("0*t",), "t", -1.0, 2.0),),
            published={BRANCH: (0.0,)},
        ),
        System(
            name="pitchfork from its side branch",
            source="by hand",
            state=("x",),
            equations=("mu*x - x**3",),
            parameters={"mu": 1.0},
            parameter="mu",
            x0=(1.0,),
            span=(-1.0, 2.0),
            curves=(Curve(("t",), "t**2", -1.5, 1.5),),
            published={BRANCH: (0.0,)},
        ),
        System(
            name="imperfect pitchfork",
            source="by hand: mu = 3 (h/2)^(2/3)",
            state=("x",),
            equations=("h + mu*x - x**3",),
            parameters={"mu": 1.0, "h": 1e-4},
            parameter="mu",
            x0=(-1.0,),
            span=(-1.0, 2.0),
            curves=(Curve(("t",), "t**2 - h/t", -2.0, -1e-5),),
            published={FOLD: (3 * (1e-4 / 2) ** (2 / 3),)},
        ),
        System(
            name="closed branch",
            source="by hand: a circle",
            state=("x",),
            equations=("x**2 + mu**2 - 1",),
            parameters={"mu": 0.0},
            parameter="mu",
            x0=(1.0,),
            span=(-3.0, 3.0),
            curves=(
                Curve(("cos(t)",), "sin(t)", -0.1, 2 * math.pi - 0.1),  # the folds once each
            ),
            published={FOLD: (-1.0, 1.0)},
        ),
        System(
            name="hysteresis without a fold",
            source="by hand: mu = x^3 has a vertical tangent at 0 but does not turn",
            state=("x",),
            equations=("mu - x**3",),
            parameters={"mu": -1.0},
            parameter="mu",
            x0=(-1.0,),
            span=(-2.0, 2.0),
            curves=(Curve(("t",), "t**3", -1.3, 1.3),),
        ),
        System(
            name="Bogdanov-Takens, focus side",
            source=f"{KUZNETSOV}, 8.4: fold b1 = b2^2/4, Hopf b1 = 0",
            state=("x", "y"),
            equations=("y", "b1 + b2*x + x**2 + x*y"),
            parameters={"b1": -1.0, "b2": -1.0},
            parameter="b1",
            x0=(-0.6, 0.0),
            span=(-2.0, 1.0),
            curves=(Curve(("t", "0*t"), "-b2*t - t**2", -1.3, 2.3),),
            # the Hopf point at x = 0 and nothing on the saddles' side
            published={FOLD: (0.25,), HOPF: (0.0,)},
        ),
        System(
            name="Bogdanov-Takens, saddle side",
            source=f"{KUZNETSOV}, 8.4: for b2 > 0 the saddle at x = 0 is neutral",
            state=("x", "y"),
            equations=("y", "b1 + b2*x + x**2 + x*y"),
            parameters={"b1": -1.0, "b2": 1.0},
            parameter="b1",
            x0=(0.62, 0.0),
            span=(-2.0, 1.0),
            curves=(Curve(("t", "0*t"), "-b2*t - t**2", -2.3, 1.3),),
            published={FOLD: (0.25,), NEUTRAL: (0.0,)},
        ),
        System(
            name="FitzHugh-Nagumo",
            source="FitzHugh, Biophys. J. 1, 1961, 445-466; v = -+sqrt(1 - b c) by hand",
            state=("v", "w"),
            equations=("v - v**3/3 - w + I", "c*(v + a - b*w)"),
            parameters={"I": 0.0, "a": 0.7, "b": 0.8, "c": 0.08},
            parameter="I",
            x0=(-1.2, -0.62),
            span=(-0.5, 2.0),
            curves=(Curve(("t", "(t + a)/b"), "t**3/3 - t + (t + a)/b", -2.0, 2.0),),
            published={
                HOPF: tuple(
                    v**3 / 3 - v + (v + 0.7) / 0.8 for v in (-math.sqrt(0.936), math.sqrt(0.936))
                )
            },
        ),
        System(
            name="Morris-Lecar",
            source="Rinzel, Ermentrout, Analysis of neural excitability and oscillations, 1998",
            state=("V", "w"),
            equations=(
                "(I - gL*(V - VL) - gK*w*(V - VK) - gCa*0.5*(1 + tanh((V - V1)/V2))*(V - VCa))/20",
                "phi*(0.5*(1 + tanh((V - V3)/V4)) - w)*cosh((V - V3)/(2*V4))",
            ),
            parameters={
                "I": 0.0,
                "phi": 0.0667,
                "gL": 2.0,
                "gK": 8.0,
                "gCa": 4.0,
                "VL": -60.0,
                "VK": -84.0,
                "VCa": 120.0,
                "V1": -1.2,
                "V2": 18.0,
                "V3": 12.0,
                "V4": 17.4,
            },
            parameter="I",
            x0=(-59.5, 0.0),
            span=(-60.0, 300.0),
            curves=(
                Curve(
                    ("t", "w"),
                    "gL*(t - VL) + gK*w*(t - VK) + gCa*0.5*(1 + tanh((t - V1)/V2))*(t - VCa)",
                    -80.0,
                    60.0,
                    {"w": "0.5*(1 + tanh((t - V3)/V4))"},
                ),
            ),
        ),
        System(
            name="Hodgkin-Huxley",
            source="Hodgkin, Huxley, J. Physiol. 117, 1952, 500-544, potential measured from rest",
            state=("V", "m", "n", "h"),
            equations=(
                "I - 120*m**3*h*(V - 115) - 36*n**4*(V + 12) - 0.3*(V - 10.599)",
                "0.1*(25 - V)/(exp((25 - V)/10) - 1)*(1 - m) - 4*exp(-V/18)*m",
                "0.01*(10 - V)/(exp((10 - V)/10) - 1)*(1 - n) - 0.125*exp(-V/80)*n",
                "0.07*exp(-V/20)*(1 - h) - 1/(exp((30 - V)/10) + 1)*h",
            ),
            parameters={"I": 0.0},
            parameter="I",
            x0=(0.0, 0.05, 0.32, 0.6),
            span=(0.0, 200.0),
            curves=(
                Curve(
                    ("t", "m", "n", "h"),
                    "120*m**3*h*(t - 115) + 36*n**4*(t + 12) + 0.3*(t - 10.599)",
                    -1.0,
                    26.0,
                    {
                        "am": "0.1*(25 - t)/(exp((25 - t)/10) - 1)",
                        "an": "0.01*(10 - t)/(exp((10 - t)/10) - 1)",
                        "ah": "0.07*exp(-t/20)",
                        "m": "am/(am + 4*exp(-t/18))",
                        "n": "an/(an + 0.125*exp(-t/80))",
                        "h": "ah/(ah + 1/(exp((30 - t)/10) + 1))",
                    },
                ),
            ),
        ),
        System(
            name="Selkov",
            source="Selkov, Eur. J. Biochem. 4, 1968, 79-86; Strogatz, Nonlinear Dynamics, 7.3: "
            "b^2 = (1 - 2a -+ sqrt(1 - 8a))/2",
            state=("x", "y"),
            equations=("-x + a*y + x**2*y", "b - a*y - x**2*y"),
            parameters={"b": 0.1, "a": 0.1},
            parameter="b",
            x0=(0.1, 0.9),
            span=(0.05, 1.5),
            curves=(Curve(("t", "t/(a + t**2)"), "t", 0.05, 1.5),),
            published={HOPF: tuple(math.sqrt((0.8 + s * math.sqrt(0.2)) / 2) for s in (-1.0, 1.0))},
        ),
        System(
            name="Roessler",
            source="Roessler, Phys. Lett. A 57, 1976, 397-398: fold c = 2 sqrt(a b) by hand",
            state=("x", "y", "z"),
            equations=("-y - z", "x + a*y", "b + z*(x - c)"),
            parameters={"c": 0.6, "a": 0.2, "b": 0.1},
            parameter="c",
            x0=(0.035, -0.18, 0.18),
            span=(-1.0, 10.0),
            curves=(Curve(("t", "-t/a", "t/a"), "t + a*b/t", 1.5e-3, 11.0),),
            published={FOLD: (2 * math.sqrt(0.02),)},
        ),
        System(
            name="Lorenz-84",
            source="Lorenz, Tellus A 36, 1984, 98-110; "
            "Shilnikov, Nicolis, Nicolis, Int. J. Bif. Chaos 5, 1995, 1701-1711",
            state=("x", "y", "z"),
            equations=(
                "-y**2 - z**2 - a*x + a*F",
                "x*y - b*x*z - y + G",
                "b*x*y + x*z - z",
            ),
            parameters={"F": 0.5, "G": 1.0, "a": 0.25, "b": 4.0},
            parameter="F",
            x0=(-0.4, 0.31, -0.36),
            span=(0.0, 6.0),
            curves=(
                Curve(
                    ("t", "G*(1 - t)/d", "G*b*t/d"),
                    "t + G**2/(a*d)",
                    -0.5,
                    6.0,
                    {"d": "(t - 1)**2 + b**2*t**2"},
                ),
            ),
        ),
        System(
            name="stirred tank",
            source="Uppal, Ray, Poore, Chem. Eng. Sci. 29, 1974, 967-985",
            state=("x", "T"),
            equations=(
                "-x + D*(1 - x)*exp(T/(1 + T/g))",
                "-T + B*D*(1 - x)*exp(T/(1 + T/g)) - b*T",
            ),
            parameters={"D": 0.02, "B": 22.0, "b": 3.0, "g": 40.0},
            parameter="D",
            x0=(0.02, 0.1),
            span=(0.01, 0.5),
            curves=(
                Curve(("t", "T"), "t/(1 - t)*exp(-T/(1 + T/g))", 1e-3, 0.999, {"T": "B*t/(1 + b)"}),
            ),
        ),
        System(
            name="Bazykin",
            source=f"Bazykin 1985; {KUZNETSOV}, 8.3.5 (predator-prey with competition)",
            state=("x", "y"),
            equations=(
                "x - x*y/(1 + al*x) - ep*x**2",
                "-ga*y + x*y/(1 + al*x) - de*y**2",
            ),
            parameters={"de": 0.3, "al": 0.3, "ga": 1.0, "ep": 0.01},
            parameter="de",
            x0=(2.87, 1.8),
            span=(0.0, 0.6),
            curves=(
                Curve(
                    ("t", "y"),
                    "(t/(1 + al*t) - ga)/y",
                    1.4,
                    99.0,
                    {"y": "(1 + al*t)*(1 - ep*t)"},
                ),
            ),
        ),
        System(
            name="Rosenzweig-MacArthur, prey alone",
            source="Rosenzweig, MacArthur, Am. Nat. 97, 1963, 209-223: K = d/(c - d)",
            state=("x", "y"),
            equations=("x*(1 - x/K) - x*y/(1 + x)", "y*(c*x/(1 + x) - d)"),
            parameters={"K": 0.5, "c": 1.0, "d": 0.6},
            parameter="K",
            x0=(0.5, 0.0),
            span=(0.3, 6.0),
            curves=(Curve(("t", "0*t"), "t", 0.3, 6.0),),
            # the eigenvalues -1 and c K/(1 + K) - d stay above -1 and below 1: no neutral saddle
            published={BRANCH: (1.5,)},
        ),
        System(
            name="Rosenzweig-MacArthur, both",
            source="Rosenzweig, MacArthur, Am. Nat. 97, 1963, 209-223: K = 1 + 2 d/(c - d)",
            state=("x", "y"),
            equations=("x*(1 - x/K) - x*y/(1 + x)", "y*(c*x/(1 + x) - d)"),
            parameters={"K": 2.0, "c": 1.0, "d": 0.6},
            parameter="K",
            x0=(1.5, 0.625),
            span=(1.0, 6.0),
            # the prey is d/(c - d) = 3/2 whatever K
            curves=(
                Curve(("d/(c - d) + 0*t", "(1 + d/(c - d))*(1 - d/(c - d)/t)"), "t", 1.0, 6.0),
            ),
            published={BRANCH: (1.5,), HOPF: (4.0,)},
        ),
        System(
            name="two Brusselators",
            source="by hand: symmetric Hopf 1 + A^2, antisymmetric branch point and Hopf point",
            state=("x", "y", "u", "v"),
            equations=(
                "A - (B + 1)*x + x**2*y + d*(u - x)",
                "B*x - x**2*y + D*(v - y)",
                "A - (B + 1)*u + u**2*v + d*(x - u)",
                "B*u - u**2*v + D*(y - v)",
            ),
            parameters={"B": 1.0, "A": 1.0, "d": 0.2, "D": 1.0},
            parameter="B",
            x0=(1.0, 1.0, 1.0, 1.0),
            span=(0.5, 6.0),
            curves=(Curve(("A + 0*t", "t/A", "A + 0*t", "t/A"), "t", 0.5, 6.0),),
            # antisymmetric: det = 0 at (1+2d)(A^2+2D)/(2D) = 2.1; past it the pair is real, and
            # its sum vanishes at 1+A^2+2d+2D = 4.4: neutral, as are sums across the two blocks
            published={HOPF: (2.0,), BRANCH: (2.1,)},
        ),
        System(
            name="column of two links",
            source="by hand: loads at which K - P 1 is singular, (3 -+ sqrt 5)/2",
            state=("p", "q"),
            equations=("P*sin(p) - 2*p + q", "P*sin(q) + p - q"),
            parameters={"P": 0.1},
            parameter="P",
            x0=(0.0, 0.0),
            span=(0.1, 4.0),
            curves=(Curve(("0*t", "0*t"), "t", 0.1, 4.0),),
            # the matrix is symmetric: the sum 2 P - 3 vanishes between, at a neutral saddle
            published={
                BRANCH: ((3 - math.sqrt(5)) / 2, (3 + math.sqrt(5)) / 2),
                NEUTRAL: (1.5,),
            },
        ),
        System(
            name="Hopf point between real pairs",
            source="by hand: complex eigenvalues for |mu| < 0.02 only, omega = 0.01 at mu = 0",
            state=("x", "y"),
            equations=("y", "-x/10000 + mu*y - y**3"),
            parameters={"mu": -1.0},
            parameter="mu",
            x0=(0.0, 0.0),
            span=(-1.0, 1.0),
            curves=(Curve(("0*t", "0*t"), "t", -1.0, 1.0),),
            published={HOPF: (0.0,)},
        ),
        System(
            name="two Hopf points a hair apart",
            source="by hand: two uncoupled oscillators, at mu = 0 and mu = 1/500",
            state=("x", "y", "u", "v"),
            equations=(
                "mu*x - y - x*(x**2 + y**2)",
                "x + mu*y - y*(x**2 + y**2)",
                "(mu - 1/500)*u - 3*v - u*(u**2 + v**2)",
                "3*u + (mu - 1/500)*v - v*(u**2 + v**2)",
            ),
            parameters={"mu": -1.0},
            parameter="mu",
            x0=(0.0, 0.0, 0.0, 0.0),
            span=(-1.0, 1.0),
            curves=(Curve(("0*t", "0*t", "0*t", "0*t"), "t", -1.0, 1.0),),
            published={HOPF: (0.0, 0.002)},
        ),
        System(
            name="two folds a hair apart",
            source="by hand: the cusp at l = 0.003, folds -+2 (l/3)^(3/2) = -+6.3e-5",
            state=("x",),
            equations=("mu + l*x - x**3",),
            parameters={"mu": -1.0, "l": 0.003},
            parameter="mu",
            x0=(-1.0,),
            span=(-1.5, 1.5),
            curves=(Curve(("t",), "t**3 - l*t", -1.2, 1.2),),
            published={FOLD: (-2 * 0.001**1.5, 2 * 0.001**1.5)},
        ),
        System(
            name="scales of 1e-6 and 1e6",
            source="the A -> B reaction in other units: the same parameters",
            state=("u1", "u2"),
            equations=(
                "1e-6*(-u1*1e6 + p1*(1 - u1*1e6)*exp(u2*1e-6))",
                "1e6*(-u2*1e-6 + p1*p2*(1 - u1*1e6)*exp(u2*1e-6) - p3*u2*1e-6)",
            ),
            parameters={"p1": 0.0, "p2": 14.0, "p3": 2.0},
            parameter="p1",
            x0=(0.0, 0.0),
            span=(0.0, 0.15),
            curves=(
                Curve(
                    ("1e-6*t", "1e6*p2*t/(1 + p3)"),
                    "t*exp(-p2*t/(1 + p3))/(1 - t)",
                    0.0,
                    0.999,
                ),
            ),
            published={FOLD: (0.0889318462, 0.1057389783), HOPF: (0.1309000448,)},
            digits=6e-11,
        ),
        System(
            name="logarithm",
            source="by hand: log x = mu x has its fold at x = e; f is defined for x > 0 alone",
            state=("x",),
            equations=("log(x) - mu*x",),
            parameters={"mu": 0.1},
            parameter="mu",
            x0=(1.1,),
            span=(-1.0, 1.0),
            curves=(Curve(("t",), "log(t)/t", 0.57, 40.0),),
            published={FOLD: (math.exp(-1),)},
            bounds={"x": (0.0, 30.0)},
        ),
    )
}
