"""The three pictures of the start page, made by phasekit itself."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

import phasekit as pk


def write(folder: Path) -> None:
    """Write the pictures: equations of one's own, the rotor, a map over parameters."""
    for name, draw in {"equations": _equations, "rotor": _rotor, "map": _map}.items():
        figure = Figure(figsize=(4.0, 3.0), layout="constrained")
        draw(figure.subplots())
        figure.savefig(folder / f"door_{name}.png", dpi=200)


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


def _disk() -> pk.GyroRotorDisk:
    return pk.GyroRotorDisk(beta=84 * pk.deg, e=0.05, a=0.012, r=0.2, omega1=300 * pk.rpm)
