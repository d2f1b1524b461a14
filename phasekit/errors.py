"""Exceptions that phasekit raises, and the integer codes that its results hold.

The codes are stored as int8 with CF ``flag_values`` and ``flag_meanings``; the enumerations
give them names: ``ds.kind == pk.EquilibriumKind.SADDLE``.
"""

from __future__ import annotations

import os
import sys
import warnings
from enum import IntEnum

#: Where phasekit is.
_HOME = os.path.join(os.path.dirname(os.path.abspath(__file__)), "")


class PhasekitError(Exception):
    """Base class of the errors that phasekit raises.

    Examples
    --------
    >>> import phasekit as pk
    >>> try:
    ...     pk.Reduced(0.1, float("inf"))
    ... except pk.PhasekitError as error:
    ...     print(error)
    psi: got inf, wants a finite number
    """


class ParameterError(PhasekitError, ValueError):
    """An argument is invalid; the message names it, says what it got and what it wants.

    Examples
    --------
    >>> import phasekit as pk
    >>> try:
    ...     pk.Pendulum(length=-1.0)
    ... except pk.ParameterError as error:
    ...     print(error)
    length: got -1.0, wants a number > 0 in m
    """


class ArgumentError(ParameterError, TypeError):
    """A call does not fit the function: an argument is unknown, missing or given twice.

    Examples
    --------
    >>> import phasekit as pk
    >>> try:
    ...     pk.melnikov(pk.Perturbed(pk.Pendulum(length=1.0)), side="left")
    ... except pk.ParameterError as error:
    ...     print(error)
    melnikov() got an unexpected keyword argument 'side'; its arguments are system
    """


class InvalidCellsWarning(ParameterError, UserWarning):
    """Cells of an array have invalid parameters: they are NaN, and -1 in counts.

    Examples
    --------
    >>> import warnings
    >>> import phasekit as pk
    >>> with warnings.catch_warnings():
    ...     warnings.simplefilter("ignore", pk.InvalidCellsWarning)
    ...     pk.equilibria(pk.Pendulum(length=[-1.0, 1.0])).n_equilibria.values.tolist()
    [-1, 2]
    """


class ConvergenceError(PhasekitError, RuntimeError):
    """An iteration did not reach its tolerance.

    Examples
    --------
    >>> import phasekit as pk
    >>> try:
    ...     pk.continuation(pk.Problem("1 + x**2", "x", {"p": 0.0}), "p", x0=[1.0], span=(0, 1))
    ... except pk.ConvergenceError:
    ...     print("no equilibrium near the start")
    no equilibrium near the start
    """


class StoreError(PhasekitError, OSError):
    """A stored map cannot be read, written or continued.

    Examples
    --------
    >>> import phasekit as pk
    >>> try:
    ...     pk.open_map("nowhere.zarr")
    ... except pk.StoreError:
    ...     print("no map there")
    no map there
    """


def warn(text: str, kind: type[Warning] = UserWarning) -> None:
    """Warn, at the line outside of phasekit that led here."""
    place = frame = sys._getframe(1)
    while (caller := frame.f_back) is not None:
        if frame.f_code.co_filename.startswith(_HOME):
            place = caller
        frame = caller
    seen = place.f_globals.setdefault("__warningregistry__", {})
    name = place.f_globals.get("__name__", "<unknown>")
    warnings.warn_explicit(text, kind, place.f_code.co_filename, place.f_lineno, name, seen)


class EquilibriumKind(IntEnum):
    """Type of an equilibrium, by the sign of V''.

    Examples
    --------
    >>> import phasekit as pk
    >>> ds = pk.equilibria(pk.Reduced(0.4, 0.1))
    >>> int((ds.kind == pk.EquilibriumKind.SADDLE).sum())
    2
    """

    NOT_COMPUTED = -1
    ABSENT = 0
    CENTER = 1
    SADDLE = 2
    DEGENERATE = 3


class FlowEquilibriumKind(IntEnum):
    """Type of an equilibrium of a flow, or of a fixed point of a map, by its eigenvalues.

    The first codes are those of `EquilibriumKind`. A focus has a complex pair nearest to the border
    of stability, a node a real eigenvalue. Degenerate are those with an eigenvalue on that border,
    within its error.

    Examples
    --------
    >>> import phasekit as pk
    >>> spring = pk.Problem({"x": "v", "v": "-x - d*v"}, parameters={"d": 0.1})
    >>> ds = pk.equilibria(spring, box={"x": (-1, 1), "v": (-1, 1)})
    >>> pk.FlowEquilibriumKind(ds.kind.item()).name
    'STABLE_FOCUS'
    """

    NOT_COMPUTED = -1
    ABSENT = 0
    CENTER = 1
    SADDLE = 2
    DEGENERATE = 3
    STABLE_NODE = 4
    UNSTABLE_NODE = 5
    STABLE_FOCUS = 6
    UNSTABLE_FOCUS = 7


class SpecialPointKind(IntEnum):
    """Kind of a special point on a branch of equilibria, or of fixed points of a map.

    Examples
    --------
    >>> import phasekit as pk
    >>> cusp = pk.Problem("mu + nu*x - x^3", "x", {"mu": 0.0, "nu": 1.0}, window={"x": (-3, 3)})
    >>> ds = pk.sweep(cusp, nu=[0.75], along=("mu", (-1, 1)), of="special_points")
    >>> [pk.SpecialPointKind(k).name for k in ds.special_kind.values[0]]
    ['FOLD', 'FOLD']
    """

    ABSENT = 0
    FOLD = 1
    BRANCH_POINT = 2
    PITCHFORK = 3
    TRANSCRITICAL = 4
    HOPF = 5
    NEUTRAL_SADDLE = 6
    BOGDANOV_TAKENS = 7
    PERIOD_DOUBLING = 8
    TORUS = 9
    OTHER = 10


class PointStatus(IntEnum):
    """Whether a special point solves its defining equations, or is a guess.

    Examples
    --------
    >>> import phasekit as pk
    >>> cusp = pk.Problem("mu + nu*x - x^3", "x", {"mu": 0.0, "nu": 1.0}, window={"x": (-3, 3)})
    >>> ds = pk.sweep(cusp, nu=[-1.0, 0.75], along=("mu", (-1, 1)), of="special_points")
    >>> pk.PointStatus(ds.special_status.sel(nu=0.75, special_point=0).item()).name
    'CONVERGED'
    """

    ABSENT = 0
    CONVERGED = 1
    GUESS = 2


class BranchStatus(IntEnum):
    """Whether the branches of a cell of a map are all there are, and if not, why.

    ``COMPLETE``: all equilibria in the window at both ends of the span are proved to be there, and
    each branch through them was followed to its ends. ``UNPROVED``: the same without the proof.
    ``CUT``: a branch ended within the span, for its number of points or as it could not go on, or a
    family of periodic orbits did, or could not be begun. ``MISSED``: a special point that
    all neighbours have is, or may be, in the cell as well, but on no branch of it.
    ``NO_EQUILIBRIUM``: there is none in the window at either end. ``FAILED``: nothing was followed.
    ``NOT_COMPUTED``: the parameters are no numbers.

    Examples
    --------
    >>> import phasekit as pk
    >>> none = pk.Problem("a + x^2 + mu^2", "x", {"a": 1.0, "mu": 0.0}, window={"x": (-3, 3)})
    >>> ds = pk.sweep(none, a=[1.0], along=("mu", (-1, 1)), of="n_fold")
    >>> pk.BranchStatus(ds.branch_status.item()).name
    'NO_EQUILIBRIUM'
    """

    NOT_COMPUTED = -1
    COMPLETE = 0
    UNPROVED = 1
    CUT = 2
    MISSED = 3
    NO_EQUILIBRIUM = 4
    FAILED = 5


class MergerKind(IntEnum):
    """How equilibria merge or cross at a critical value of a parameter.

    A branch point is one of which it is not decided how.

    Examples
    --------
    >>> import phasekit as pk
    >>> well = pk.Potential("x^4/4 - m*x^2/2", "x", {"m": 1.0})
    >>> kind = pk.critical(well, "m", (-1.0, 1.0)).critical_fold_kind
    >>> [pk.MergerKind(code).name for code in kind.values]
    ['PITCHFORK']
    """

    ABSENT = 0
    FOLD = 1
    PITCHFORK = 2
    TRANSCRITICAL = 3
    CUSP = 4
    BRANCH_POINT = 5


class AttractorKind(IntEnum):
    """Where the motions of a damped system end.

    Examples
    --------
    >>> import phasekit as pk
    >>> pendulum = pk.Perturbed(pk.Coefficients(0.0, 1.0, 0.0), damping=0.1, torque=1.5)
    >>> ds = pk.attractors(pendulum, phi=[0.0, 2.0], dphi=[0.0, 1.0])
    >>> [pk.AttractorKind(kind).name for kind in ds.attractor_kind.values]
    ['ROTATION']
    """

    UNKNOWN = -1
    EQUILIBRIUM = 0
    CYCLE = 1
    ROTATION = 2
    TORUS = 3
    CHAOTIC = 4


class Topology(IntEnum):
    """What the separatrices of one system look like.

    On a line they may close on one side of a saddle alone (homoclinic), or on neither (unbounded).

    Examples
    --------
    >>> import phasekit as pk
    >>> pk.Topology(pk.separatrices(pk.Reduced(0.4, 0.1)).topology.item()).name
    'FIGURE_EIGHT'
    """

    NOT_COMPUTED = -1
    NONE = 0
    WINDING = 1
    FIGURE_EIGHT = 2
    HETEROCLINIC = 3
    HOMOCLINIC = 4
    UNBOUNDED = 5


class Loop(IntEnum):
    """What the separatrix of one saddle does: close on itself, wind round, or reach a partner.

    On a line it may close on one side alone (lobe), or on neither (unbounded).

    Examples
    --------
    >>> import phasekit as pk
    >>> [pk.Loop(code).name for code in pk.separatrices(pk.Reduced(0.4, 0.1)).loop.values]
    ['LOBES', 'WINDING']
    """

    ABSENT = 0
    LOBES = 1
    WINDING = 2
    HETEROCLINIC = 3
    LOBE = 4
    UNBOUNDED = 5


class EscapeRegime(IntEnum):
    """What limits the escape of a particle from a well by thermal noise.

    Examples
    --------
    >>> import phasekit as pk
    >>> warm = pk.Perturbed(pk.Pendulum(length=1.0, g=1.0), damping=3.0, kT=0.2)
    >>> code = pk.escape_rate(warm).escape_regime.sel(saddle="upper", side="right").item()
    >>> pk.EscapeRegime(code).name
    'SPATIAL_DIFFUSION'
    """

    NOT_COMPUTED = -1
    ABSENT = 0
    ENERGY_DIFFUSION = 1
    TURNOVER = 2
    SPATIAL_DIFFUSION = 3


class Validity(IntEnum):
    """Whether a result of first order in damping and drive holds, or else why it does not.

    NOT_WEAK: a motion loses more in one round than the theory allows. NO_EQUILIBRIUM: the torque
    leaves no equilibrium, or empties a well. FORCED, NOISY: a drive or noise decides, too. TILTED:
    a torque changes the separatrix, and with it the threshold, by more than about a quarter.
    ABSENT: there is no such separatrix. STRONG_DRIVE: at the threshold the drive is not weak,
    or a torque beside it, so that the threshold, which is given, may be off by more than about a
    quarter.

    Examples
    --------
    >>> import phasekit as pk
    >>> strong = pk.Perturbed(pk.Pendulum(length=1.0, g=1.0), damping=50.0)
    >>> pk.Validity(pk.retrapping_torque(strong).retrapping_validity.values[0]).name
    'NO_EQUILIBRIUM'
    """

    NOT_COMPUTED = -1
    ABSENT = 0
    HOLDS = 1
    NOT_WEAK = 2
    NO_EQUILIBRIUM = 3
    FORCED = 4
    NOISY = 5
    TILTED = 6
    STRONG_DRIVE = 7


class OrbitKind(IntEnum):
    """Type of an orbit. An unbounded orbit leaves the line, or the interval of the potential.

    Under a constant torque a running orbit goes round for ever and gains energy each turn.

    Examples
    --------
    >>> import phasekit as pk
    >>> pk.OrbitKind(pk.orbits(pk.Pendulum(length=1.0), 0.0, 9.0).orbit_kind.item()).name
    'ROTATION'
    """

    NOT_COMPUTED = -1
    EQUILIBRIUM = 0
    LIBRATION = 1
    ROTATION = 2
    ASYMPTOTIC = 3
    UNBOUNDED = 4
    RUNNING = 5


class OrbitFamily(IntEnum):
    """Family of orbits. In each family the action identifies the orbit.

    Examples
    --------
    >>> import phasekit as pk
    >>> ds = pk.action_angle(pk.Pendulum(length=1.0), 0.0, -9.0)
    >>> pk.OrbitFamily(ds.orbit_family.item()).name
    'BACKWARD'
    """

    NOT_COMPUTED = -1
    NONE = 0
    LOWER_WELL = 1
    UPPER_WELL = 2
    OUTER = 3
    FORWARD = 4
    BACKWARD = 5
