"""Pictures of the start page, and of pages whose code draws them, made by phasekit itself."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

import phasekit as pk


def write(folder: Path) -> None:
    """Write the pictures: of the three doors, and of pages with one picture or two of a kind."""
    for name, draw in {"equations": _equations, "rotor": _rotor, "map": _map}.items():
        figure = Figure(figsize=(4.0, 3.0), layout="constrained")
        draw(figure.subplots())
        figure.savefig(folder / f"door_{name}.png", dpi=200)
    pages = {
        "continuation": _continuation, "cycles": _cycles, "motor": _motor, "basins": _basins,
        "tour": _tour,
    }  # fmt: skip
    for name, draw_row in pages.items():
        figure = Figure(figsize=(8.0, 3.2), layout="constrained")
        draw_row(*figure.subplots(1, 2))
        figure.savefig(folder / f"page_{name}.png", dpi=120)


def _equations(ax: Axes) -> None:
    neuron = pk.Problem(
        {"v": "v - v^3/3 - w + I", "w": "0.08*(v + 0.7 - 0.8*w)"},
        parameters={"I": 0.5},
        window={"v": (-2.5, 2.5), "w": (-1.0, 2.0)},
    )
    pk.plot.phase_portrait(neuron, orbits=[(-2.0, 1.5), (0.5, 0.0)], legend=False, ax=ax)


def _rotor(ax: Axes) -> None:
    pk.plot.phase_portrait(_disk(), legend=False, ax=ax)


def _map(ax: Axes) -> None:
    ds = pk.sweep(_disk(), beta=np.linspace(0, 90, 181) * pk.deg, a=np.linspace(-0.06, 0.06, 161))
    pk.plot.parameter_map(ds, "topology", angles="deg", ax=ax)


def _continuation(left: Axes, right: Axes) -> None:
    reaction = pk.Problem(
        {"u1": "-u1 + p1*(1 - u1)*exp(u2)", "u2": "-u2 + p1*p2*(1 - u1)*exp(u2) - p3*u2"},
        parameters={"p1": 0.0, "p2": 14.0, "p3": 2.0},
    )
    branch = pk.continuation(reaction, "p1", span=(0, 0.2))
    branch.plot(ax=left)
    branch.special("fold")[0].curve("p3", (1.5, 3.0)).plot(ax=right)


def _cycles(left: Axes, right: Axes) -> None:
    reaction = pk.Problem(
        {"u1": "-u1 + p1*(1 - u1)*exp(u2)", "u2": "-u2 + p1*p2*(1 - u1)*exp(u2) - p3*u2"},
        parameters={"p1": 0.1, "p2": 14.0, "p3": 3.0},
    )
    rest = pk.continuation(reaction, "p1", x0=[0.1, 0.7], span=(0.0, 0.5))
    cycles = rest.special("H")[0].switch()
    pk.plot.branch([rest, cycles], ax=left)
    orbit = cycles.orbit(cycles.special("LPC")[0].index)
    right.plot(orbit.time, orbit.u1)
    right.set(xlabel="time", ylabel="u1")


def _motor(left: Axes, right: Axes) -> None:
    motor = pk.Term("pull*(1 - dphi/idle)", {"pull": 0.5, "idle": 3.0})
    friction = pk.Term("-mu*tanh(dphi/width)", {"mu": 0.1, "width": 0.01})
    turned = pk.Perturbed(pk.Pendulum(length=1.0, g=1.0), terms=[motor, friction])
    pk.continuation(turned, "pull", x0=[0.5, 0.0], span=(0.0, 2.0)).plot(ax=left)
    ds = pk.flow(turned.replace(pull=1.5), 0.0, 0.0, np.linspace(0.0, 20.0, 401))
    right.plot(ds.time, ds.motion_dphi)
    right.set(xlabel="time (s)", ylabel="angular velocity (rad/s)")


def _basins(left: Axes, right: Axes) -> None:
    eight = pk.Perturbed(pk.Coefficients(1.0, 0.35, 0.12), damping=0.05)
    ds = pk.basins(eight, phi=np.linspace(-np.pi, np.pi, 201), dphi=np.linspace(-2.5, 2.5, 161))
    pk.plot.basins(ds, ax=left)
    motions = pk.flow(eight, 1.0, [1.0, 1.1], np.linspace(0.0, 60.0, 601))
    for motion in motions.motion_phi.transpose("time", ...).values.T:
        right.plot(motions.time, motion)
    right.set(xlabel="time (s)", ylabel="angle (rad)")


def _tour(left: Axes, right: Axes) -> None:
    curves = pk.bifurcation_set(_disk(), "beta", "a", xlim=(0, 1.57), ylim=(-0.06, 0.06))
    pk.plot.bifurcation_set(curves, angles="deg", ax=left)
    problem = pk.Problem("mu + x - x**3", state="x", parameters={"mu": -1.0})
    pk.continuation(problem, "mu", x0=[-1.3], span=(-1, 1)).plot(ax=right)


def _disk() -> pk.GyroRotorDisk:
    return pk.GyroRotorDisk(beta=84 * pk.deg, e=0.05, a=0.012, r=0.2, omega1=300 * pk.rpm)
