"""Every kernel gives the same bits interpreted, in its quick form and in its finished one.

Calls that phasekit makes are kept, the first of each kernel, and made again: as they were, and with
numbers exchanged for random and for extreme ones. What stands for a function in compiled code (see
`twin`) is interpreted in its place, and native functions are called by their addresses.
"""

import copy
import ctypes
import functools
import importlib
import pkgutil
import sys
import time
import warnings
from contextlib import contextmanager

import numpy as np
import pytest
from scipy import sparse

import phasekit
import phasekit as pk
from phasekit.loads.functions import orbit_forces
from phasekit.motion.kernels.dop853 import MOST
from phasekit.numerics import launch, marks
from phasekit.numerics.factors import entries_of
from phasekit.numerics.forms import QUICK, python_function
from phasekit.numerics.kernels import KERNELS, Kernel
from phasekit.numerics.values import normal

EXTREME = (0.0, -0.0, np.inf, -np.inf, np.nan, 5e-324, 1e-300, -1e300, 1.7e308, 1.0 + 2**-52)
#: Whole numbers above this are addresses.
ADDRESS = 2**32
#: A kernel that halves its steps until they are shorter than its shortest one; with other numbers
#: in their place it would never end.
HALVING = "phasekit.bifurcation.continuation.kernels.trace.trace"
#: Calls kept of each kernel, and the seconds, compiled, up to which they are interpreted.
CALLS, SECONDS = 2, 0.001


def name_of(kernel):
    return f"{kernel.py_func.__module__}.{kernel.py_func.__qualname__}"


@functools.cache
def all_kernels():
    """Kernels of the package by their names, all of its modules being imported."""
    for module in pkgutil.walk_packages(phasekit.__path__, "phasekit."):
        if not module.name.endswith("__main__"):
            importlib.import_module(module.name)
    ours = (one for one in list(KERNELS) if one.py_func.__module__.startswith("phasekit."))
    return {name_of(one): one for one in ours}


class Native:
    """Python's way to call machine code that takes arrays."""

    def __init__(self, address):
        self.address = address

    def __call__(self, *arrays):
        function = ctypes.CFUNCTYPE(None, *[ctypes.c_void_p] * len(arrays))(self.address)
        function(*(one.ctypes.data for one in arrays))


def without_natives(args):
    return tuple(x.address if isinstance(x, Native) else x for x in args)


@functools.cache
def compiled_names():
    """Where modules name what compiled code runs, and what is interpreted in its place."""
    found = []
    for name, module in list(sys.modules.items()):
        if not name.startswith("phasekit.") or module is None:
            continue
        for key, value in list(vars(module).items()):
            mark = marks.mark_of(value)
            if mark is not None and mark.body is not value:
                found.append((vars(module), key, value, mark.body))
    return found


class Calls(dict):
    """The first calls of each kernel."""

    def take(self, kernel, args, run):
        calls = self.setdefault(kernel, [])
        if len(calls) < CALLS:
            calls.append(without_natives(copy.deepcopy(args)))
        return run(*args)

    @contextmanager
    def compiled(self):
        """Keep what is called compiled."""
        call = Kernel.__call__
        Kernel.__call__ = lambda kernel, *args: self.take(
            kernel, args, lambda *given: call(kernel, *given)
        )
        try:
            yield
        finally:
            Kernel.__call__ = call

    @contextmanager
    def interpreted(self):
        """Interpret what compiled code runs; keep the calls of kernels by kernels."""
        places = compiled_names()
        for names, key, value, body in places:
            if isinstance(value, Kernel):

                def body(*args, kernel=value):
                    return self.take(kernel, args, kernel.py_func)

            names[key] = body
        try:
            yield
        finally:
            for names, key, value, _ in places:
                names[key] = value


def few_cells():
    """Call all that has kernels, for a few cells each."""
    disk = pk.GyroRotorDisk(
        beta=1.0, e=0.05, a=0.012, r=0.2, omega1=31.4, m=2.0, half_span=0.2, g=9.81
    )
    beta, a = np.linspace(0.1, 1.5, 3), np.linspace(-0.06, 0.06, 2)
    groups = ["equilibria", "separatrices", "separatrix_forces", "separatrix_rotators"]
    pk.sweep(disk, beta=beta, a=a, of=groups)
    pk.bearing_forces(disk, phi=[0.3], dphi=[0.2])
    pk.rotators(disk, phi=[0.3], dphi=[0.2])
    pk.fixed_bearing_forces(disk, phi=[0.3], dphi=[0.2], rho_b1=0.4)
    orbit_forces(**disk.parameters, phi0=[0.1], dphi0=[0.2])
    system = pk.Coefficients(4.0, 1.0, 0.5)
    pk.orbits(system, [-1.0, 0.5], 0.3)
    state = pk.action_angle(system, [-1.0, 0.5], 0.3)
    pk.state_of(system, state.action, state.angle, state.orbit_family)
    pk.flow(system, [0.3, 0.5], 0.3, np.linspace(0.0, 3.0, 4))
    pk.orbit_families(system, 3)
    pk.separatrix_motion(system, np.linspace(0.0, 1.0, 3))


def perturbed():
    damped = pk.Perturbed(pk.Pendulum(length=9.81), damping=0.1)
    driven = damped.replace(forcing=pk.Harmonic(0.5, 0.7))
    pk.capture(damped)
    pk.capture(pk.Perturbed(pk.Coefficients(1.0, 0.5, 0.1), damping=0.003, drift={"B": 1e-3}))
    pk.melnikov(driven)
    pk.flow(driven, [0.1, 0.2], 0.2, np.linspace(0.0, 1.0, 3))
    pk.flow(damped.replace(kT=0.1), 0.1, 0.2, np.linspace(0.0, 1.0, 3), paths=2, seed=1)
    pk.lyapunov(driven, 0.1, 0.0, duration=20.0)
    pk.basins(driven, phi=[-3.0, 3.0], dphi=[-2.0, 2.0])
    pk.basins(damped.replace(damping=1e3), phi=[-3.0, 3.0], dphi=[0.0])
    pk.basins(driven.replace(damping=1e3), phi=[-3.0, 3.0], dphi=[0.0])
    # A rotation whose orbit does not close soon.
    pk.basins(driven.replace(damping=1e3, torque=3.0), phi=[-3.0, 3.0], dphi=[0.0])


def neuron():
    rates = {"v": "v - v^3/3 - w + current", "w": "eps*(v + 0.7 - 0.8*w)"}
    window = {"v": (-2.5, 2.5), "w": (-1.0, 2.0)}
    return pk.Problem(rates, parameters={"current": 0.2, "eps": 0.08}, window=window)


def branches():
    rest = pk.continuation(neuron(), "current", x0=[-1.2, -0.6], span=(0.0, 2.0))
    rest.special("hopf")[0].curve("eps", span=(0.05, 0.1))
    family = rest.special("hopf")[0].switch()
    list(family.special_points)
    forced = pk.Problem(
        ["v", "F*cos(w*t) - 0.2*v - x - x^3"], ("x", "v"), {"w": 0.5, "F": 0.3},
        time="t", period="2*pi/w",
    )  # fmt: skip
    orbit = pk.periodic_orbit(forced, [0.0, 0.0])
    pk.continuation(forced, "w", orbit=orbit, span=(0.4, 0.6))
    ring = {"x": "x*(1 - x^2 - y^2) - y", "y": "y*(1 - x^2 - y^2) + x", "z": "-z", "w": "-2*w"}
    pk.periodic_orbit(pk.Problem(ring), [1.0, 0.0, 0.0, 0.0])
    code = pk.Problem(lambda x, mu: [mu * x[0] - x[0] ** 3, -x[1]], ("x", "y"), {"mu": -1.0})
    pk.continuation(code, "mu", span=(-1.0, 1.0))
    entries_of(sparse.csc_array(np.eye(9) + np.eye(9, k=5) + np.eye(9, k=-4)))
    cusp = pk.Problem(["mu + b*x - x^3"], "x", {"mu": 0.0, "b": 1.0})
    branch = pk.continuation(cusp, "mu", x0=[-1.5], span=(-2.0, 2.0))
    list(branch.special("fold")[0].curve("b", span=(-1.0, 2.0)).special_points)


def motions():
    cell = neuron()
    times = np.linspace(0.0, 3.0, 4)
    pk.flow(cell, v=[0.1, 0.3], w=0.2, t=times, method="rosenbrock")
    pk.flow(cell, v=[0.1, 0.3], w=0.2, t=times, method="taylor")
    pk.equilibria(cell)
    pk.nullclines(cell)
    pk.poincare_section(cell, section="v", v=[1.0, 2.0], w=0.5, duration=100.0)
    noisy = pk.Problem(
        {"x": "x - x^3"}, noise={"x": 0.5}, start={"x": -1.0}, window={"x": (-2.0, 2.0)}
    )
    pk.flow(noisy, x=[0.1], t=times, paths=2, seed=1)
    pk.first_passage(noisy, target="x", duration=5.0, paths=2, seed=1)
    pk.manifolds(
        pk.Problem({"x": "v", "v": "x - x^3 - 0.1*v"}, window={"x": (-2, 2), "v": (-2, 2)})
    )


SUBJECTS = (few_cells, perturbed, branches, motions)


@pytest.fixture(scope="module")
def calls():
    """Calls of kernels by all subjects, and by these kernels when they are interpreted."""
    found = Calls()
    given = launch.INTERPRETED_AT_MOST
    launch.INTERPRETED_AT_MOST = 0
    try:
        with found.compiled(), warnings.catch_warnings():
            warnings.simplefilter("ignore")
            for subject in SUBJECTS:
                subject()
    finally:
        launch.INTERPRETED_AT_MOST = given
    for kernel, kept in list(found.items()):
        kept.sort(key=lambda args: sum(x.size for x in args if isinstance(x, np.ndarray)))
        began = time.process_time()
        outcome(kernel, kept[0])
        if time.process_time() - began < 10 * SECONDS:
            interpreted(found, kernel, kept[0])
    return found


def bits(x):
    """The bits of numbers; of NaN, whose own are the processor's affair, that it is one."""
    if isinstance(x, tuple):
        return tuple(map(bits, x))
    if isinstance(x, np.ndarray):
        array = np.ascontiguousarray(x)
        if array.dtype.kind == "f":
            array = np.where(np.isnan(array), np.nan, array)
        return array.shape, array.tobytes()
    if isinstance(x, (float, np.floating)):
        return bits(np.array([x], dtype=float))
    return x


def outcome(function, args):
    given = copy.deepcopy(args)
    with np.errstate(all="ignore"):
        result = function(*given)
    return bits(result), bits(given)


def interpreted(found, kernel, args):
    given = tuple(Native(x) if type(x) is int and x > ADDRESS else x for x in copy.deepcopy(args))
    with found.interpreted(), np.errstate(all="ignore"):
        result = kernel.py_func(*given)
    return bits(result), bits(without_natives(given))


def exchanged(names, args, rng, values):
    """Arguments with one number in eight of each array exchanged."""

    def other(x):
        if isinstance(x, tuple):
            return tuple(map(other, x))
        if isinstance(x, np.ndarray) and x.dtype.kind == "f":
            x = np.array(x)
            hit = rng.random(x.shape) < 0.125
            x[hit] = values(rng, int(hit.sum()))
        return x

    changed = {name: other(x) for name, x in zip(names, args, strict=True)}
    if "limits" in changed:  # of motions, which would take all steps that they may
        changed["limits"] = dict(zip(names, args, strict=True))["limits"].copy()
        changed["limits"][MOST] = 200.0
    return tuple(changed.values())


def random(rng, count):
    return rng.normal(size=count)


def extreme(rng, count):
    return rng.choice(EXTREME, size=count)


def test_every_kernel_is_called(calls):
    assert {name_of(kernel) for kernel in calls} >= set(all_kernels())


@pytest.mark.parametrize("name", sorted(all_kernels()))
def test_all_forms_give_the_same_bits(calls, name):
    kernel = all_kernels()[name]
    rng = np.random.default_rng(0)
    tried = 0
    for args in calls[kernel]:
        pairs = [normal(x, one) for x, one in zip(args, kernel._annotations, strict=True)]
        kinds = tuple(kind for _, kind in pairs)
        values = tuple(value for value, _ in pairs)
        quick, finished = (
            python_function(kernel.py_func, kinds, effort, make=True)
            for effort in (QUICK, kernel.effort)
        )
        others = (exchanged(kernel.names, values, rng, how) for how in (random, extreme))
        for given in (values, *(others if name != HALVING else ())):
            began = time.process_time()
            expected = outcome(finished, given)
            spent = time.process_time() - began
            assert outcome(quick, given) == expected
            if spent < SECONDS or not tried:
                try:
                    found = interpreted(calls, kernel, given)
                except (ArithmeticError, ValueError):  # by `math`, whose compiled code gives NaN
                    assert given is not values
                else:
                    assert found == expected
                    tried += 1
    assert tried
