"""All options of a continuation in one frozen object."""

from __future__ import annotations

import functools
from collections.abc import Mapping, Sequence, Set
from dataclasses import dataclass, field, fields
from types import MappingProxyType
from typing import Any

import numpy as np

from phasekit.errors import ParameterError
from phasekit.inputs import bad, call_checked, one_of, reals, whole
from phasekit.pickles import Stamped

DIRECTIONS = ("both", "forward", "backward")
DETECTED = ("fold", "branch_point", "hopf")
DETECTABLE = (*DETECTED, "neutral_saddle")


@dataclass(frozen=True, kw_only=True)
class ContinuationOptions(Stamped):
    """Options of a continuation. The defaults suit most problems.

    Lengths are measured on scaled axes: the parameter by the width of its span, an angle by its
    period over 2 pi, another state by its size along the branch (or by `scales`). So a step of
    0.05 is a twentieth of the span where only the parameter changes.

    Parameters
    ----------
    max_step : float, default 0.05
        Longest step. Make it smaller where a branch jumps to another one or for a smoother
        picture; larger for long, dull branches. What is narrower than a step, and leaves no trace
        at its ends, is passed unseen.
    min_step : float, default 1e-9
        Shortest step, below which the branch ends as stuck. Rarely changed.
    initial_step : float, default 0.01
        First step. Make it smaller where already the first step goes astray.
    max_points : int, default 2000
        Most points in each direction. A branch that ends for this reason can be extended.
    tolerance : float, default 1e-11
        Size of the last Newton step, on scaled axes, at which a point counts as found; the step
        is still made, so that points are accurate to rounding. Raise it for functions that are
        noisy (1e-7 for the result of an integration).
    max_iterations : int, default 8
        Newton steps for one point before the step is shortened.
    turn : float, default 0.15
        Angle in rad between the tangents of neighbouring points that steps aim at. Make it
        smaller for a smoother curve, larger for speed.
    max_turn : float, default 0.5
        Angle at which a step is refused and shortened. Make it smaller where a branch jumps.
    directions : {"both", "forward", "backward"}
        From the start to both sides, or only towards larger or smaller parameters.
    detect : sequence of {"fold", "branch_point", "hopf", "neutral_saddle"}
        What is looked for; by default all but neutral saddles, which up to 10 states come with Hopf
        points: of more there are very many. With nothing asked for and more than 16 states no
        eigenvalues are computed, which take most of the time then: n_unstable is -1.
    bounds : mapping of str to (float, float), optional
        Limits of states by name (and of other free parameters): the branch ends on them.
    scales : mapping of str to float, optional
        Sizes of states by name, where those found along the branch mislead.
    certify : bool, default False
        Of equilibria and fixed points of formulas: whether branches are proved (see
        `continuation`), those that are switched to as well.
    degree : int, default 4
        Of periodic orbits: degree of the polynomials between the ends of mesh intervals, 2 to 7.
    intervals : int, optional
        Of periodic orbits: a fixed number of mesh intervals. By default as many are taken as the
        mesh tolerance asks for, at each point anew.
    max_intervals : int, default 1000
        Of periodic orbits: the most mesh intervals; a branch that needs more ends as stuck.
    mesh_tolerance : float, default 1e-8
        Of periodic orbits: estimated error of the states between mesh points, beside their
        amplitudes, above which the mesh is refined. Periods and multipliers are more accurate.

    Raises
    ------
    ParameterError
        If a value is unusable.

    Notes
    -----
    Steps go along the tangent, by arclength, and back by Newton's method across it
    ([AllgowerGeorg1990] chapters 4 and 6); the step grows and shrinks with the angle between
    tangents.

    Examples
    --------
    >>> options = ContinuationOptions(max_step=0.01)
    >>> options.max_step
    0.01
    >>> ContinuationOptions(**options.as_dict()) == options
    True
    """

    max_step: float = 0.05
    min_step: float = 1e-9
    initial_step: float = 0.01
    max_points: int = 2000
    tolerance: float = 1e-11
    max_iterations: int = 8
    turn: float = 0.15
    max_turn: float = 0.5
    directions: str = "both"
    detect: tuple[str, ...] = DETECTED
    bounds: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    scales: Mapping[str, float] = field(default_factory=dict)
    certify: bool = False
    degree: int = 4
    intervals: int | None = None
    max_intervals: int = 1000
    mesh_tolerance: float = 1e-8

    def __post_init__(self) -> None:
        """Check every value."""
        for name in (
            "max_step",
            "min_step",
            "initial_step",
            "tolerance",
            "turn",
            "max_turn",
            "mesh_tolerance",
        ):
            value = _number(name, getattr(self, name))
            if not value > 0.0:
                raise bad(name, value, "a number > 0")
            object.__setattr__(self, name, value)
        if not 2 <= whole("degree", self.degree, "a whole number from 2 to 7") <= 7:
            raise bad("degree", self.degree, "a whole number from 2 to 7")
        if self.intervals is not None and whole("intervals", self.intervals, "None or >= 4") < 4:
            raise bad("intervals", self.intervals, "None, or a whole number >= 4")
        for name in ("max_points", "max_iterations", "max_intervals"):
            value = whole(name, getattr(self, name), "a whole number >= 1")
            object.__setattr__(self, name, value)
        if not self.min_step <= self.initial_step:
            raise ParameterError(
                f"initial_step: got {self.initial_step}, wants at least min_step = {self.min_step}"
            )
        if not self.initial_step <= self.max_step:
            object.__setattr__(self, "initial_step", self.max_step)
        if not self.min_step < self.max_step:
            raise ParameterError(
                f"max_step: got {self.max_step}, wants more than min_step = {self.min_step}"
            )
        if not self.tolerance <= 1e-3:
            raise ParameterError(f"tolerance: got {self.tolerance}, wants at most 1e-3")
        if not self.turn <= self.max_turn < 1.5:
            raise ParameterError(
                f"max_turn: got {self.max_turn} with turn = {self.turn}, wants turn <= max_turn "
                "< 1.5 rad"
            )
        one_of("directions", self.directions, DIRECTIONS)
        if not isinstance(self.certify, (bool, np.bool_)):
            raise bad("certify", self.certify, "True or False")
        object.__setattr__(self, "certify", bool(self.certify))
        given: Any = self.detect
        if not isinstance(given, (str, Sequence, Set)):
            raise bad("detect", given, f"names out of {', '.join(DETECTABLE)}")
        detect = (given,) if isinstance(given, str) else tuple(given)
        for name in detect:
            one_of("detect", name, DETECTABLE)
        object.__setattr__(self, "detect", detect)
        bounds = {}
        for name, pair in _mapping("bounds", self.bounds).items():
            wants = f"for {name} a pair (low, high) with low < high"
            ends = reals("bounds", pair, wants)
            if ends.shape != (2,) or not ends[0] < ends[1]:
                raise bad("bounds", pair, wants)
            bounds[name] = (float(ends[0]), float(ends[1]))
        object.__setattr__(self, "bounds", MappingProxyType(bounds))
        scales = {}
        for name, value in _mapping("scales", self.scales).items():
            scales[name] = _number(f"scales[{name!r}]", value)
            if not scales[name] > 0.0:
                raise bad("scales", value, f"for {name} a number > 0")
        object.__setattr__(self, "scales", MappingProxyType(scales))

    def __reduce__(self) -> tuple[Any, ...]:
        """Copies and pickles are made from the values."""
        return functools.partial(type(self), **self.as_dict()), ()

    def as_dict(self) -> dict[str, Any]:
        """The options as plain values, which make the same options again.

        Returns
        -------
        dict
        """
        values = {f.name: getattr(self, f.name) for f in fields(self)}
        values["detect"] = list(self.detect)
        values["bounds"] = {name: list(pair) for name, pair in self.bounds.items()}
        values["scales"] = dict(self.scales)
        return values

    def __hash__(self) -> int:
        """Hash of the values."""
        return hash(repr(self.as_dict()))


_init = ContinuationOptions.__init__
ContinuationOptions.__init__ = call_checked(_init, "ContinuationOptions")  # type: ignore[method-assign]


def _number(name: str, value: Any) -> float:
    number = reals(name, value, "a finite number")
    if number.ndim or not np.isfinite(number):
        raise bad(name, value, "a finite number")
    return float(number)


def _mapping(name: str, value: Any) -> dict[str, Any]:
    if not isinstance(value, Mapping):
        raise bad(name, value, "a mapping from names")
    return dict(value)


#: What holds where nothing is said.
DEFAULTS = ContinuationOptions()
