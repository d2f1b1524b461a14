"""Files of XPPAUT: what they mean, by functions written anew, and what is refused."""

import math
from pathlib import Path

import numpy as np
import pytest
import sympy as sp

import phasekit as pk
from phasekit.systems.ode_problem import read_ode

FILES = Path(__file__).parents[1] / "data" / "ode"


def membrane(x, t=0.0):
    v, w = x
    half = lambda u: 0.5 * (1 + math.tanh(u))  # noqa: E731
    ica = 1.3 * half((v + 0.01) / 0.15) * (v - 1)
    return [
        0.15 + 0.5 * (-0.5 - v) + 2 * w * (-0.7 - v) - ica,
        0.3 * math.cosh((v - 0.1) / 0.29) * (half((v - 0.1) / 0.145) - w),
    ]


def ring(x, t=0.0):
    x, y = np.reshape(x, (4, 2)).T
    rates = [-y, x - 0.5 * (x.mean() - x) - np.arange(1, 5) / 100]
    return np.ravel(np.transpose(rates))


def pulse(z, t=0.0):
    x, y = z
    branch = (x >= 0.25) + 1.5 if x > 0 and y < 1 else -(1.5**6)
    drift = -math.log(3 + y) * np.sign(y) + max(x, -2) * abs(y) / math.atan2(1, 2)
    return [
        -(x**3) + branch + 0.1 * math.cos(4 * t),
        2 * (x >= 0.25) + drift + 0.1 * math.sin(6 * t) ** 2 - 2.0,
    ]


def henon(z, t=0.0):
    return [z[1] + 1 - 1.4 * z[0] ** 2, 0.3 * z[0]]


@pytest.mark.parametrize("rates", [membrane, ring, pulse, henon], ids=lambda f: f.__name__)
def test_equations_mean_what_xppaut_says(rates):
    problem = pk.Problem.from_ode(FILES / f"{rates.__name__}.ode")
    rng = np.random.default_rng(1)
    names = [*problem.state, *problem.parameters, "t"]
    f = sp.lambdify([sp.Symbol(name, real=True) for name in names], list(problem.f), "math")
    for t in (0.0, 0.7):
        for x in rng.uniform(-1.5, 1.5, (20, len(problem.state))):
            found = f(*x, *problem.parameters.values(), t)
            np.testing.assert_allclose(found, rates(x, t), rtol=1e-12, atol=1e-13)


@pytest.mark.slow
def test_everything_else_that_a_file_says():
    problem = pk.Problem.from_ode(str(FILES / "membrane.ode"))
    assert problem.state == ("V", "w")
    assert list(problem.parameters) == ["Iapp", "phi", "V1", "v2", "v3", "v4", "gca"]
    assert dict(problem.start) == {"V": -0.3, "w": 0.1}
    assert dict(problem.window) == {"V": (-0.6, 1.2), "w": (-0.25, 1.25)}
    ds = pk.flow(problem.replace(phi=[0.3, 0.6]), t=[0.0, 2.0])
    np.testing.assert_array_equal(ds.motion_V[:, 0], -0.3)
    np.testing.assert_allclose(ds.motion_slow, ds.motion_w / ds.phi, rtol=1e-14)
    v = ds.motion_V.values
    ica = 1.3 * 0.5 * (1 + np.tanh((v + 0.01) / 0.15)) * (v - 1)
    np.testing.assert_allclose(ds.motion_I_ca, ica, rtol=1e-13)

    forced = pk.Problem.from_ode(FILES / "pulse.ode")
    assert forced.time == "t"
    assert forced.forcing_period == pytest.approx(math.pi / 2, rel=1e-15)  # cos 4t and sin^2 6t
    assert dict(forced.start) == {"x": 6.0, "y": 0.0}

    ring = pk.Problem.from_ode(FILES / "ring.ode")
    assert ring.state == ("x1", "y1", "x2", "y2", "x3", "y3", "x4", "y4")
    assert [ring.start[f"x{j}"] for j in range(1, 5)] == [0.2, 0.4, 0.6, 0.8]
    assert str(ring.observables["first"]) == "y2"

    read = read_ode(FILES / "henon.ode", pk.Problem)
    assert read.problem.map
    assert dict(read.problem.periods) == {"y": 5.0}
    assert read.options["meth"] == "discrete"
    assert pk.flow(read.problem, [0.5, 0.2], t=[1]).motion_both.item() == pytest.approx(0.85 * 0.15)
    assert pk.Problem.from_specification(problem.specification()) == problem


@pytest.mark.parametrize(
    ("lines", "line", "said"),
    [
        ("x'=-delay(x,tau)\npar tau=1", 1, "delay(...), a delay"),
        ("x'=-x\nglobal 1 x-1 {x=0}", 2, "a state that jumps at an event"),
        ("x'=-x\n\nmarkov z 2\n{0} {1}\n{1} {0}", 3, "a Markov process"),
        ("x'=y\n0=x+y\nsolve y=1", 2, "an algebraic equation"),
        ("u(t)=sin(t)+int{exp(-t)#u}", 1, "an integral over the past"),
        ("x'=f(x)\ntable f % 51 0 1 t^2", 2, "a table of values"),
        ("x'=-flr(x)", 1, "flr(...), a function with jumps"),
        ("x'=ran(1)-x", 1, "ran(...), random numbers"),
        ("x'=-x\npar a=2*pi", 2, "a=2*pi, wants a number"),
        ("x'=-x\nexport {x} {y}", 2, "code of a library"),
        ("x'=-x\nspecial k=conv(even,5,1,w,x)", 2, "sums over arrays"),
        ("x'=-q\nq=r\nr=2*q", 3, "unknown symbol q"),
        ("x'=-q\nq=q+1", 2, "q in its own formula"),
        ("x'=-x\npar X=1", 2, "X once more"),
        ("x'=-x\ninit y=1", 2, "a start of y, which is no state"),
        ("x'=-x+", 1, "its end at character 4"),
        ("x'=2-(x", 1, "a closing parenthesis"),
        ("x'=u[j]", 1, "[j] in"),
        ("x'=if(x>1)(2)else(3)", 1, "then(...)"),
        ("x'=-x\nhello", 2, "a statement of an .ode file"),
    ],
)
def test_what_is_no_flow_is_refused_by_name_and_line(tmp_path, lines, line, said):
    file = tmp_path / "model.ode"
    file.write_text(lines + "\ndone\n")
    with pytest.raises(pk.ParameterError) as error:
        pk.Problem.from_ode(file)
    message = str(error.value)
    assert message.startswith(f"model.ode, line {line}: got")
    assert said in message


def test_files_that_are_none(tmp_path):
    with pytest.raises(pk.ParameterError, match=r"path: .*No such file"):
        pk.Problem.from_ode(tmp_path / "none.ode")
    (tmp_path / "empty.ode").write_text("# nothing\npar a=1\n")
    with pytest.raises(pk.ParameterError, match=r"empty.ode: got no equation"):
        pk.Problem.from_ode(tmp_path / "empty.ode")


def test_time_without_a_period(tmp_path):
    file = tmp_path / "decay.ode"
    file.write_text("x'=-x+exp(-t)\nx(0)=2\n")
    problem = pk.Problem.from_ode(file)
    assert (problem.time, problem.period, problem.forcing_period) == ("t", None, math.inf)
    t = np.linspace(0.0, 3.0, 7)
    np.testing.assert_allclose(pk.flow(problem, t=t).motion_x, (2 + t) * np.exp(-t), rtol=1e-9)
    with pytest.raises(pk.ParameterError, match="an f with a period in time"):
        pk.periodic_orbit(problem, [1.0])
    with pytest.raises(pk.ParameterError, match="has a period of its own"):
        pk.stroboscopic(problem, n=3)
