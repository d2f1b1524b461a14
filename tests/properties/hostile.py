"""Every public callable with arguments that fit, and a pool of values that mostly do not."""

from __future__ import annotations

import datetime
import enum
import functools
import inspect
import warnings
from collections.abc import Callable
from decimal import Decimal
from fractions import Fraction
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import xarray as xr

import phasekit as pk
from phasekit.cli import main
from phasekit.explorer.explore import Explorer
from phasekit.inputs import describe
from phasekit.labelled.accessor import MapPlots, PhasekitAccessor
from phasekit.mechanics.general.state import CoupledRotationState
from phasekit.systems.trajectory import Trajectory

#: What models share for the rest of the package, and results that only phasekit makes.
MACHINERY = {"in_domain", "valid_coefficients", "formula_inputs", "unit_of"}
RESULTS = (pk.Atlas, pk.Branch, pk.CycleBranch, pk.ConnectionBranch, pk.SpecialPoint)


class Odd:
    """A foreign object whose own code fails."""

    def __array__(self, *args: Any, **kwargs: Any) -> Any:
        raise RuntimeError("no array")

    def __repr__(self) -> str:
        raise RuntimeError("no name")


def _locked(array: Any) -> Any:
    array.flags.writeable = False
    return array


def _nested(depth: int) -> list[Any]:
    value: list[Any] = [1.0]
    for _ in range(depth):
        value = [value]
    return value


def _recursive() -> list[Any]:
    value: list[Any] = []
    value.append(value)
    return value


#: Made anew for each call, as some can be used once only.
POOL: dict[str, Callable[[], Any]] = {
    "none": lambda: None,
    "true": lambda: True,
    "numpy bool": lambda: np.True_,
    "zero": lambda: 0.0,
    "minus zero": lambda: -0.0,
    "one": lambda: 1,
    "minus one": lambda: -1,
    "half": lambda: 2.5,
    "pi": lambda: np.pi,
    "minus pi": lambda: -np.pi,
    "nan": lambda: np.nan,
    "inf": lambda: np.inf,
    "minus inf": lambda: -np.inf,
    "1e16": lambda: 1e16,
    "1e200": lambda: 1e200,
    "1e300": lambda: 1e300,
    "-1e300": lambda: -1e300,
    "1e-320": lambda: 1e-320,
    "10**400": lambda: 10**400,
    "10**5000": lambda: -(10**5000),
    "2**63": lambda: 2**63,
    "complex": lambda: 1 + 2j,
    "fraction": lambda: Fraction(1, 3),
    "decimal": lambda: Decimal("0.5"),
    "signalling": lambda: Decimal("sNaN"),
    "float16": lambda: np.float16(0.5),
    "longdouble": lambda: np.longdouble("1e4000"),
    "big-endian": lambda: np.array([0.1, 0.2], ">f8"),
    "word": lambda: "abc",
    "empty word": lambda: "",
    "unit": lambda: "30deg",
    "nul": lambda: "a\0b",
    "bytes": lambda: b"abc",
    "date": lambda: datetime.date(2020, 1, 1),
    "datetime64": lambda: np.datetime64("2020-01-01"),
    "timedelta64": lambda: np.timedelta64(1, "s"),
    "timedelta": lambda: datetime.timedelta(seconds=1),
    "not a time": lambda: np.array(["NaT"], "timedelta64[ns]"),
    "object": object,
    "odd object": Odd,
    "class": lambda: float,
    "function": lambda: lambda *a, **k: 1.0,
    "empty list": list,
    "empty array": lambda: np.empty(0),
    "empty rows": lambda: np.empty((0, 2)),
    "empty dict": dict,
    "list": lambda: [0.1, 0.2],
    "falling list": lambda: [0.2, 0.1],
    "equal list": lambda: [0.1, 0.1],
    "three": lambda: (0.1, 0.2, 0.3),
    "nan in list": lambda: [0.1, np.nan],
    "huge in list": lambda: [1e300, -1e300],
    "10**400 in list": lambda: [0.1, 10**400],
    "bool in list": lambda: [0.1, True],
    "none in list": lambda: [None, 0.1],
    "words": lambda: ["a", "b"],
    "mixed": lambda: ["a", 1.0, None],
    "ragged": lambda: [[1.0], [1.0, 2.0]],
    "deep": lambda: _nested(70),
    "recursive": _recursive,
    "set": lambda: {0.1, 0.2},
    "generator": lambda: (x for x in (0.1, 0.2)),
    "range": lambda: range(2),
    "dict": lambda: {"a": 0.1},
    "dict of numbers": lambda: {1: 2},
    "slice": lambda: slice(None),
    "0-d": lambda: np.array(0.3),
    "bools": lambda: np.array([True, False]),
    "complexes": lambda: np.array([1j, 2.0]),
    "objects": lambda: np.array([0.1, "a"], object),
    "fractions": lambda: [Fraction(1, 3), Decimal("0.5")],
    "structured": lambda: np.zeros(2, "f8,f8"),
    "2-D": lambda: np.ones((2, 2)),
    "reversed": lambda: np.arange(4.0)[::-2],
    "read-only": lambda: _locked(np.array([0.1, 0.2])),
    "masked": lambda: np.ma.array([0.1, 0.2], mask=[False, True]),
    "all masked": lambda: np.ma.masked_all(2),
    "masked scalar": lambda: np.ma.masked,
    "masked in list": lambda: [0.1, np.ma.masked],
    "series": lambda: pd.Series([0.1, 0.2], name="beta"),
    "missing": lambda: pd.Series([0.1, pd.NA], dtype="Float64"),
    "index": lambda: pd.Index([0.1, 0.2]),
    "frame": lambda: pd.DataFrame({"a": [0.1, 0.2]}),
    "DataArray": lambda: xr.DataArray([0.1, 0.2], dims="x"),
    "degrees": lambda: xr.DataArray([10.0, 20.0], dims="x", attrs={"units": "deg"}),
    "furlongs": lambda: xr.DataArray(0.1, attrs={"units": "furlong"}),
    "odd units": lambda: xr.DataArray([0.1], dims="x", attrs={"units": ["deg"]}),
    "0-d DataArray": lambda: xr.DataArray(0.3),
    "nan DataArray": lambda: xr.DataArray(np.nan),
    "2-D DataArray": lambda: xr.DataArray(np.ones((2, 3)), dims=("x", "y")),
    "dim of a result": lambda: xr.DataArray([0.1, 0.2], dims="equilibrium"),
    "numbered dim": lambda: xr.DataArray([0.1, 0.2], dims=[3]),
    "coordinate of words": lambda: xr.DataArray([0.1, 0.2], {"x": ["a", "b"]}, "x"),
    "words DataArray": lambda: xr.DataArray(["a", "b"], dims="x"),
    "lazy": lambda: xr.DataArray([0.1, 0.2], dims="x").chunk(x=1),
    "Variable": lambda: xr.Variable("x", [0.1, 0.2]),
    "empty Dataset": xr.Dataset,
    "Dataset": lambda: xr.Dataset({"phi": ("x", [0.1])}, attrs={"phasekit_model": "Reduced"}),
    "system": lambda: pk.Coefficients(2.0, 1.0, 0.5),
    "array system": lambda: pk.Coefficients([2.0, -3.0], 1.0, 0.5),
    "huge system": lambda: pk.Coefficients(1e300, 1e300, 1e-320),
    "forceless": lambda: pk.Coefficients(0.0, 0.0, 0.0),
    "options": lambda: pk.ContinuationOptions(max_points=5),
    "body": lambda: pk.RigidBody(1.0, [0.0, 0.0, 0.0], np.eye(3)),
}

DISK = {"beta": 0.3, "e": 0.1, "a": 0.05, "r": 0.1, "omega1": 10.0, "m": 2.0, "half_span": 0.1}


@functools.cache
def disk() -> Any:
    return pk.GyroRotorDisk(**DISK)


@functools.cache
def dataset() -> xr.Dataset:
    return pk.sweep(disk(), beta=[0.2, 0.3], a=[0.0, 0.05])


@functools.cache
def loads() -> xr.Dataset:
    return dataset().phasekit.bearing_forces(on="separatrix")


@functools.cache
def plane_atlas() -> pk.Atlas:
    cusp = pk.Problem("mu + l*x - x^3", "x", {"mu": 0.0, "l": 0.0}, window={"x": (-3, 3)})
    return pk.atlas(cusp, "mu", "l", span={"mu": (-1, 1), "l": (-1, 2)})


@functools.cache
def loci() -> xr.Dataset:
    plane = {"xlim": (-3.0, 3.0), "ylim": (-3.0, 3.0)}
    return pk.bifurcation_set(pk.Coefficients(2.0, 1.0, 0.3), "B", "C", **plane)


@functools.cache
def motion() -> xr.Dataset:
    return pk.flow(disk(), 0.3, 0.2, [0.0, 0.5])


@functools.cache
def trajectory() -> Any:
    return rotor().trajectory(0.3, 0.2, (0.0, 0.5))


@functools.cache
def map_() -> Any:
    return pk.Problem("r*x*(1 - x)", "x", {"r": 2.0}, map=True)


def front() -> pk.Problem:
    law = {"u": "v", "v": "c*v - u*(1 - u)*(u - a)"}
    return pk.Problem(law, parameters={"c": 0.28, "a": 0.3})


def tipping() -> pk.Problem:
    return pk.Problem({"x": "(x + p)^2 - mu"}, parameters={"p": 0.0, "mu": 0.25})


@functools.cache
def connected() -> Any:
    return pk.connection(front(), ([0.0, 0.0], [1.0, 0.0]), free="c")


def bounded() -> pk.BoundaryProblem:
    law = {"u": "v", "v": "-r*exp(u)"}
    return pk.BoundaryProblem(law, ["u(0)", "u(1)"], parameters={"r": 0.5})


def problem() -> Any:
    return pk.Problem("r + x**2 - 0.1*x**4", ("x",), {"r": -0.5})


@functools.cache
def branch() -> Any:
    few = pk.ContinuationOptions(max_points=40)
    return pk.continuation(problem(), "r", x0=[0.7], span=(-1.0, 0.5), options=few)


@functools.cache
def pair_of_folds() -> Any:
    cusp = pk.Problem("mu + l*x - x**3", state="x", parameters={"mu": -1.0, "l": 0.75})
    return pk.continuation(cusp, "mu", x0=[-1.3], span=(-1.0, 1.0))


@functools.cache
def oscillator() -> Any:
    return pk.Problem(["y", "mu*(1 - x**2)*y - x"], ("x", "y"), {"mu": 0.5})


@functools.cache
def cycles() -> Any:
    few = pk.ContinuationOptions(max_points=3, intervals=10)
    orbit = pk.periodic_orbit(oscillator(), [2.0, 0.0], options=few)
    return pk.continuation(oscillator(), "mu", orbit=orbit, span=(0.4, 0.6), options=few)


@functools.cache
def driven() -> Any:
    """Damped and driven."""
    system = pk.Coefficients(2.0, 1.0, 0.3)
    return pk.Perturbed(system, damping=0.2, forcing=pk.Harmonic(0.1, 1.0))


@functools.cache
def section() -> xr.Dataset:
    return pk.stroboscopic(driven(), 0.3, 0.2, n=2)


@functools.cache
def shares() -> xr.Dataset:
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "basin: ")  # so small a grid is too coarse
        return pk.basins(damped(), phi=[-1.0, 0.0, 1.0], dphi=[0.0, 0.5])


@functools.cache
def samples() -> xr.Dataset:
    steps = pk.Problem("r*x*(1 - x)", "x", {"r": 3.0}, map=True)
    return pk.orbit_diagram(steps, "r", [2.5, 3.2], 0.3, n=2)


@functools.cache
def exponents() -> xr.Dataset:
    steps = pk.Problem("r*x*(1 - x/K)", "x", {"r": 3.0, "K": 1.0}, map=True)
    return pk.sweep(steps, r=[2.5, 3.2], K=[1.0, 2.0], of="lyapunov", x=0.3, n=50)


@functools.cache
def damped() -> Any:
    return pk.Perturbed(pk.Coefficients(2.0, 1.0, 0.3), damping=0.5)


def speed(t: float) -> float:
    return 10.0 + t


@functools.cache
def started() -> xr.Dataset:
    return pk.run_up(disk(), omega1=speed, phi0=0.3, dphi0=0.2, t=[0.0, 0.1])


@functools.cache
def page() -> Any:
    return pk.explore(pk.Pendulum(length=1.0))


@functools.cache
def rotor() -> Any:
    body = pk.GyroRotorDisk(**{k: v for k, v in DISK.items() if k != "half_span"})
    return pk.FreeGyroRotor(body, 0.1)


@functools.cache
def machine() -> Any:
    return pk.CoupledRotation(
        pk.RigidBody.disk(2.0, 0.1, 0.1, 0.3), n1=(0, 0, 1), n2=(1, 0, 0), a=1
    )


@functools.cache
def well() -> Any:
    return pk.Potential("x^4/4 - mu*x^2/2", "x", {"mu": 1.0})


@functools.cache
def bistable() -> Any:
    """A flow with two attractors, and with noise."""
    law = {"x": "x - x^3"}
    return pk.Problem(law, parameters={"s": 0.1}, noise={"x": "s"}, window={"x": (-2.0, 2.0)})


@functools.cache
def planar() -> Any:
    """A flow of two states in a window."""
    window = {"x": (-2.0, 2.0), "y": (-2.0, 2.0)}
    return pk.Problem({"x": "y", "y": "x - x^3 - 0.1*y"}, window=window)


#: Arguments that fit, by the name of the callable's argument ...
GOOD: dict[str, Callable[[], Any]] = {
    "system": lambda: pk.Coefficients(2.0, 1.0, 0.3),
    "disk": disk,
    "problem": problem,
    "perturbed": driven,
    "dataset": dataset,
    "ds": dataset,
    "branches": branch,
    "body": lambda: pk.RigidBody.disk(2.0, 0.1, 0.1, 0.3),
    "parameter": lambda: "r",
    "span": lambda: (-1.0, 0.5),
    "path": lambda: "branch.json",
    "store": lambda: "map.zarr",
    "t": lambda: [0.0, 0.5],
    "phi": lambda: 0.3,
    "dphi": lambda: 0.2,
    "phi0": lambda: 0.3,
    "dphi0": lambda: 0.2,
    "x": lambda: 0.1,
    "p": lambda: 1.0,
    "label": lambda: "LP",
    "carrier_inertia": lambda: 0.1,
    "values": lambda: [1.0, 1.1],
    "duration": lambda: 1.0,
    "energy": lambda: 9.0,
    "gap": lambda: 0.1,
    "action": lambda: 0.1,
    "angle": lambda: 0.2,
    "family": lambda: "lower_well",
    "rho_b1": lambda: 0.5,
    "frame": lambda: "disk",
    "mass": lambda: 2.0,
    "center": lambda: [0.0, 0.1, 0.0],
    "inertia": lambda: np.eye(3),
    "masses": lambda: [1.0, 2.0],
    "positions": lambda: [[0.0, 0.0, 1.0], [0.0, 1.0, 0.0]],
    "amplitude": lambda: 0.1,
    "frequency": lambda: 1.0,
    "plasma_frequency": lambda: 1.0,
    "mean_motion": lambda: 1.0,
    "asymmetry": lambda: 1e-4,
    "eccentricity": lambda: 0.2,
    "rate": lambda: 1e-8,
    "matrix": lambda: np.eye(3),
    "vector": lambda: [1.0, 0.0, 0.0],
    "angular_velocity": lambda: [1.0, 0.0, 0.0],
    "n": lambda: [1.0, 0.0, 0.0],
    "n1": lambda: [0.0, 0.0, 1.0],
    "n2": lambda: [1.0, 0.0, 0.0],
    "G": lambda: [0.0, 0.0, -9.81],
    "s_A": lambda: 0.1,
    "s_B": lambda: -0.1,
    "rho_B1": lambda: 0.5,
    "f": lambda: ["r + x**2"],
    "state": lambda: ("x",),
    "parameters": lambda: {"r": -0.5},
    "potential": lambda: "x**4/4 - x**2/2",
    "expression": lambda: "x**4/4 - x**2/2",
    "coordinate": lambda: "x",
    "spec": lambda: problem().specification(),
    "axes": lambda: {"A": [1.0, 2.0]},
    "on": lambda: "equilibria",
    "v": lambda: {
        **dict.fromkeys(
            (
                "A",
                "B",
                "C",
                "lam",
                "psi",
                "Omega_sq",
                "e",
                "a",
                "r",
                "omega1",
                "g",
                "radius",
                "omega",
                "offset",
                "normal_offset",
                "length",
                "K",
                "h_x",
                "h_y",
                "plasma_frequency",
                "second_harmonic",
                "flux",
                "mean_motion",
                "asymmetry",
                "strength",
            ),
            0.7,
        ),
        **dict.fromkeys(("beta", "tilt"), (0.6, 0.8, 1.0)),
    },
    **{name: functools.partial(float, value) for name, value in DISK.items()},
    **dict.fromkeys(("A", "B", "C", "lam", "psi", "radius", "omega", "length"), lambda: 0.7),
    **dict.fromkeys(("K", "h_x", "h_y"), lambda: 0.7),
}
#: ... and where another one fits, by the callable and the argument; and what keeps calls short.
FITTING: dict[str, dict[str, Callable[[], Any]]] = {
    "orbits": {"phi0": lambda: 0.3, "dphi0": lambda: 0.2},
    "branches": {"parameter": lambda: "A"},
    "critical": {"parameter": lambda: "lam"},
    "bifurcation_set": {
        "x": lambda: "B", "y": lambda: "C", "xlim": lambda: (-3, 3), "ylim": lambda: (-3, 3),
    },
    "atlas": {
        "problem": lambda: plane_atlas().problem, "x": lambda: "mu", "y": lambda: "l",
        "span": lambda: {"mu": (-1, 1), "l": (-1, 2)},
    },
    "quasi_static": {"path": lambda: {"A": [1.0, 2.0]}},
    "plot.hysteresis_loop": {
        "dataset": lambda: pk.quasi_static(pk.Coefficients(1.0, 0.4, 0.1), A=[1.0, 0.2]),
        "x": lambda: "A", "y": lambda: "phi",
    },
    "figure_eights": {"path": lambda: {"B": (0.1, 1.0)}, "n": lambda: 5},
    "orbit_families": {"n": lambda: 3},
    "continuation": {
        "x0": lambda: [0.7], "options": lambda: pk.ContinuationOptions(max_points=10),
    },
    "bearing_forces": {"dphi": lambda: 0.2},
    "fixed_bearing_forces": {"dphi": lambda: 0.2},
    "rotators": {"dphi": lambda: 0.2},
    "sweep": {"axes": lambda: {"A": [1.0, 2.0]}, "workers": lambda: None},
    "diagram": {"options": lambda: pk.ContinuationOptions(max_points=10), "depth": lambda: 1},
    "periodic_orbit": {
        "problem": oscillator, "x0": lambda: [2.0, 0.0], "period": lambda: 6.4,
        "options": lambda: pk.ContinuationOptions(intervals=10),
    },
    "phase_response": {"orbit": lambda: cycles().orbit(0)},
    "plot.phase_response": {"dataset": lambda: pk.phase_response(cycles().orbit(0))},
    "stroboscopic": {"n": lambda: 2},
    "lyapunov": {"time": lambda: 5.0},
    "attractors": {"phi": lambda: [-1.0, 1.0], "dphi": lambda: [0.0], "period": lambda: None},
    "basins": {"phi": lambda: [-1.0, 1.0], "dphi": lambda: [0.0], "periods": lambda: 100},
    "poincare_section": {"section": lambda: 0.5, "dphi0": lambda: 0.2, "n": lambda: 2},
    "warm": {"subjects": lambda: ()},
    "fourier": {"formula": lambda: "x", "order": lambda: 1},
    "edge_state": {"system": bistable, "a": lambda: {"x": -0.5}, "b": lambda: {"x": 0.5}},
    "first_passage": {
        "system": lambda: bistable().replace(s=0.5), "x0": lambda: {"x": -1.0},
        "target": lambda: "x", "longest": lambda: 2.0, "paths": lambda: 5, "step": lambda: 0.01,
    },
    "spectrum": {"motion": lambda: pk.flow(disk(), 0.3, 0.2, np.linspace(0.0, 1.0, 33))},
    "Event": {"function": lambda: "phi"},
    "nullclines": {"system": planar},
    "plot.nullclines": {"system": planar},
    "Problem.from_antimony": {"text": lambda: "model m; A -> ; 0.1*A; A = 1; end"},
    "resonances": {"n": lambda: 2},
    "quiet_frequencies": {"n": lambda: 2},
    "escape_rate": {"perturbed": lambda: pk.Perturbed(GOOD["system"](), damping=0.5, kT=0.1)},
    "capture": {
        "perturbed": lambda: pk.Perturbed(GOOD["system"](), damping=0.5, drift={"C": 0.1}),
    },
    "run_up": {"omega1": lambda: speed, "t": lambda: [0.0, 0.1]},
    "JosephsonJunction.shunt": {"stewart_mccumber": lambda: 4.0},
    "SpinOrbit.resonance": {"p": lambda: 1.5},
    "SpinOrbit.tides": {"p": lambda: 1.5},
    "Explorer.save": {"path": lambda: "page.html"},
    "plot.multipliers": {"branch": cycles},
    "connection": {
        "problem": front, "orbit": lambda: ([0.0, 0.0], [1.0, 0.0]), "free": lambda: "c",
    },
    "fit": {
        "problem": lambda: pair_of_folds().problem,
        "targets": lambda: [(pair_of_folds().special("LP")[0], "mu", 0.2, 0.01)],
        "free": lambda: ["l"], "steps": lambda: 5,
    },
    "critical_rate": {
        "problem": tipping, "ramp": lambda: {"p": "r*p*(3 - p)"},
        "attractor": lambda: {"x": -0.5, "p": 0.0}, "edge": lambda: {"x": -2.5, "p": 3.0},
        "rate": lambda: "r", "parameters": lambda: {"r": 0.17},
    },
    "ConnectionBranch.curve": {"parameter": lambda: "a", "span": lambda: (0.29, 0.31)},
    "ConnectionBranch.save": {"path": lambda: "branch.zarr"},
    "ConnectionBranch.extend": {"points": lambda: 1},
    "ConnectionBranch.orbit": {"i": lambda: -1},
    "CycleBranch.save": {"path": lambda: "branch.zarr"},
    "CycleBranch.extend": {"points": lambda: 1},
    "CycleBranch.orbit": {"i": lambda: -1},
    "plot.basins": {"dataset": shares, "x": lambda: "phi", "y": lambda: "dphi"},
    "plot.orbit_diagram": {"dataset": samples},
    "plot.lyapunov_map": {"dataset": exponents},
    "plot.poincare_section": {"dataset": section},
    "plot.run_up": {"dataset": started},
    "plot.damped_portrait": {"system": damped},
    "FreeGyroRotor": {"disk": lambda: rotor().disk},
    "FreeGyroRotor.trajectory": {"span": lambda: (0.0, 0.5)},
    "Potential": {"parameters": dict},
    "Term": {"force": lambda: "-0.1*dphi", "parameters": dict},
    "Problem.from_potential": {"parameters": dict},
    "grid": {"name": lambda: "x", "low": lambda: 0.0, "high": lambda: 1.0, "n": lambda: 5},
    "Problem.mechanical": {
        "M": lambda: np.eye(2), "C": lambda: np.zeros((2, 2)), "K": lambda: [[2, -1], [-1, 2]],
        "force": lambda: {"x1": "x1^3"}, "forcing": lambda: {"x2": "F*cos(w*t)"},
        "parameters": lambda: {"F": 0.1, "w": 1.0}, "coordinates": lambda: ("x1", "x2"),
        "period": lambda: "2*pi/w",
    },
    "BoundaryProblem": {
        "f": lambda: ["v", "-r*exp(u)"], "conditions": lambda: ["u(0)", "u(1)"],
        "parameters": lambda: {"r": 0.5}, "state": lambda: ("u", "v"),
    },
    "BoundaryProblem.derivatives": {"x": lambda: [0.1, 0.0]},
    "BoundaryProblem.described": {"words": lambda: {"u": {"long_name": "place", "units": "m"}}},
    "Problem.from_system": {"system": disk},
    "Problem.derivatives": {"x": lambda: [0.1]},
    "Problem.iterated": {"n": lambda: 2},
    "BoundaryProblem.from_specification": {"spec": lambda: bounded().specification()},
    "Problem.described": {"words": lambda: {"x": {"long_name": "place", "units": "m"}}},
    "SpecialPoint.curve": {"parameter": lambda: "r"},
    "Branch.save": {"path": lambda: "branch.zarr"},
    "FreeGyroRotor.poincare": {"section": lambda: 0.5},
    "Branch.extend": {"points": lambda: 2},
    "open_map": {"store": lambda: "map.zarr"},
    "plot.branch_surface": {
        "x": lambda: "B", "y": lambda: "C", "xlim": lambda: (-3, 3), "ylim": lambda: (-3, 3),
        "cells": lambda: 8,
    },
    "plot.bifurcation_set": {"dataset": loci},
    "plot.atlas": {"atlas": plane_atlas},
    "plot.bearing_forces": {"orbit": lambda: (0.3, 0.2)},
    "plot.bifurcation_diagram": {"dataset": lambda: dataset().isel(a=0)},
    "plot.bearing_load_map": {"dataset": loads},
    "plot.time_history": {"dataset": motion},
    "plot.hodograph": {"system": disk},
    "plot.period_energy": {"n": lambda: 5},
    "plot.frequency_action": {"n": lambda: 5},
}  # fmt: skip
#: Instances whose methods are called, by the name of their class.
INSTANCES: dict[str, Callable[[], Any]] = {
    "ContinuationOptions": pk.ContinuationOptions,
    "Atlas": plane_atlas,
    "Branch": branch,
    "SpecialPoint": lambda: branch().special_points[0],
    "CycleBranch": cycles,
    "ConnectionBranch": connected,
    "Perturbed": driven,
    "Harmonic": lambda: pk.Harmonic(0.1, 1.0),
    "JosephsonJunction": lambda: pk.JosephsonJunction(plasma_frequency=1.0),
    "Event": lambda: pk.Event("phi"),
    "Term": lambda: pk.Term("-mu*dphi", {"mu": 0.1}),
    "SpinOrbit": lambda: pk.SpinOrbit(mean_motion=1.0, asymmetry=1e-4),
    "Explorer": page,
    "FreeGyroRotor": rotor,
    "GyroRotorDisk": disk,
    "Coefficients": lambda: pk.Coefficients(2.0, 1.0, 0.3),
    "Reduced": lambda: pk.Reduced(0.3, 0.2),
    "ParticleOnCircle": lambda: pk.ParticleOnCircle(radius=1.0, omega=3.0),
    "Pendulum": lambda: pk.Pendulum(length=1.0),
    "StonerWohlfarth": lambda: pk.StonerWohlfarth(K=1.0, h_x=0.2, h_y=0.1),
    "Potential": well,
    "Problem": problem,
    "BoundaryProblem": bounded,
    "RigidBody": lambda: GOOD["body"](),
    "CoupledRotation": machine,
    "CoupledRotationState": lambda: machine().at(omega1=1.0, phi2=0.3),
    "Trajectory": trajectory,
    "PhasekitAccessor": lambda: dataset().phasekit,
    "MapPlots": lambda: dataset().isel(beta=0, a=0).phasekit.plot,
}
#: Their classes that have no public name.
RETURNED = (CoupledRotationState, Explorer, MapPlots, PhasekitAccessor, Trajectory)
OWNERS = {owner.__name__: owner for owner in RETURNED}
OWNERS |= {name: getattr(pk, name) for name in INSTANCES.keys() - OWNERS.keys()}

#: Calls that take longer than a test should: spans over hundreds of decades ...
LONG = {(name, "huge in list") for name in ("bifurcation_set", "plot.branch_surface")}
#: ... and motions so fast or long that they take all the steps they may before they are given up.
_MOTIONS = ("attractors", "basins", "lyapunov", "poincare_section", "run_up", "stroboscopic")
LONG |= {(name, value) for name in _MOTIONS for value in ("1e16", "1e200", "huge in list")}
#: ... and the default, which compiles everything.
LONG |= {("warm", "none")}
#: Warnings that are part of an answer, by how they begin: the grid is too coarse, motions are lost.
ANNOUNCED = ("basin: ", "edge_state: ", "motion_phi: ", "the branch in .* is not complete")


def callables() -> dict[str, Callable[..., Any]]:
    """Return every public callable by its name; methods are of `INSTANCES`."""
    found: dict[str, Callable[..., Any]] = {}
    for name in pk.__all__:
        thing = getattr(pk, name)
        if inspect.isclass(thing):
            if issubclass(thing, (enum.Enum, Exception)) or thing is pk.System:  # a base
                continue
            if thing not in RESULTS:
                found[name] = thing
            assert name in INSTANCES, f"{name}: add an instance, so that its methods are called"
        elif callable(thing):
            found[name] = thing
    for name in pk.plot.__all__:
        found[f"plot.{name}"] = getattr(pk.plot, name)
    for name, make in INSTANCES.items():
        owner = OWNERS[name]
        for method in dir(owner):
            static = inspect.getattr_static(owner, method)
            plain = inspect.isfunction(static) or isinstance(static, (classmethod, staticmethod))
            if plain and not method.startswith("_") and method not in MACHINERY:
                found[f"{name}.{method}"] = functools.partial(_call, make, method)
        if method_of_maps := found.get(f"{name}.iterated"):
            found[f"{name}.iterated"] = functools.partial(_call, map_, *method_of_maps.args[1:])
        if "__call__" in vars(owner):
            found[f"{name}.__call__"] = functools.partial(_call, make, "__call__")
    return found


def _call(make: Callable[[], Any], method: str, *args: Any, **kwargs: Any) -> Any:
    return getattr(make(), method)(*args, **kwargs)


def arguments(name: str, function: Callable[..., Any]) -> dict[str, Callable[[], Any]]:
    """Return the arguments that a callable takes, each with how to make one that fits.

    What has a default and no value here is left out.
    """
    if isinstance(function, functools.partial):
        make, method = function.args
        function = getattr(make(), method)
    fitting = FITTING.get(name, {})
    taken: dict[str, Callable[[], Any]] = {}
    for parameter in inspect.signature(function).parameters.values():
        if parameter.kind in (parameter.VAR_KEYWORD, parameter.VAR_POSITIONAL):
            continue
        if parameter.name in fitting:
            taken[parameter.name] = fitting[parameter.name]
        elif parameter.default is parameter.empty:
            assert parameter.name in GOOD, f"{name}: add an argument {parameter.name} that fits"
            taken[parameter.name] = GOOD[parameter.name]
        else:
            taken[parameter.name] = lambda default=parameter.default: default
    return taken


def argv(value: Any) -> list[list[str]]:
    """Return command lines with a word in each place."""
    word = value if isinstance(value, str) else describe(value)
    disk_options = [f"--{k}={v}" for k, v in DISK.items() if k not in ("m", "half_span")]
    return [
        [word],
        ["portrait", word],
        ["portrait", f"--beta={word}", *disk_options[1:], "--out=p.png"],
        ["portrait", *disk_options, f"--out={word}"],
        ["portrait", *disk_options, f"--model={word}"],
        ["portrait", *disk_options, f"--energies={word}", "--out=p.png"],
        ["diagram", *disk_options[1:], f"--beta=0:{word}:5", "--out=d.png"],
        ["diagram", *disk_options[1:], f"--beta=0:1:{word}", "--out=d.png"],
        ["sweep", word],
        ["info", word],
        ["demo", f"--cells={word}"],
    ]


__all__ = ["POOL", "argv", "arguments", "callables", "main", "plt"]
