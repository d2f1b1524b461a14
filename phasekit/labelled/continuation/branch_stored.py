"""What a stored branch says, checked: nothing of a file is trusted before it is used.

Compiled code follows the arrays without looking at their sizes, so each has the shape that the
problem asks for before it goes there.
"""

from __future__ import annotations

import contextlib
import json
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt
import xarray as xr

from phasekit.bifurcation.continuation.curve import Curve, Stop, Track
from phasekit.bifurcation.continuation.kernels import trace
from phasekit.bifurcation.continuation.kernels.defining import EQUILIBRIUM, EVENT, HOPF, TORUS
from phasekit.bifurcation.continuation.kernels.state import NUMBERS as STATE_NUMBERS
from phasekit.bifurcation.continuation.kernels.state import VECTORS
from phasekit.bifurcation.continuation.options import ContinuationOptions
from phasekit.bifurcation.continuation.path import Sample
from phasekit.errors import ParameterError, StoreError
from phasekit.labelled.continuation.branch import KINDS, NUMBERS
from phasekit.labelled.continuation.user_events import events_of
from phasekit.labels.arguments import bad
from phasekit.maps.stored_arrays import reason
from phasekit.systems.boundary_problem import BoundaryProblem
from phasekit.systems.identity import SCHEMA, SCHEMA_VERSION
from phasekit.systems.problem import Problem
from phasekit.systems.registry import model_named

Array = npt.NDArray[np.float64]

#: Arrays of a curve, by name.
ARRAYS = ("par", "scale", "period", "low", "high")
_REASONS = ("bound", "closed", "max_points", "interrupted", "stuck", "not_finite", "start")
#: Bytes of an array that any file may hold, and how many times smaller it may be stored.
_SMALL, _RATIO = 1 << 26, 1000


@contextlib.contextmanager
def damaged(name: str, what: str) -> Iterator[None]:
    """Say of whatever goes wrong that a part of a stored branch is damaged."""
    try:
        yield
    except StoreError:
        raise
    except MemoryError as error:
        raise StoreError(f"path: {name} cannot be read: {reason(error)}") from error
    except Exception as error:  # whatever is made of values that are not what they were
        kind = "" if isinstance(error, ParameterError) else f"{type(error).__name__}: "
        why = f"{kind}{error}"
        raise StoreError(
            f"path: {name} is damaged: {what}: {why[:500]}; take another copy, or trace and save "
            "the branch again"
        ) from error


class Stored:
    """A stored branch; each part is checked when it is asked for."""

    def __init__(self, ds: xr.Dataset, name: str, size: int) -> None:
        """Take what was opened, what messages call it, and its bytes on the disk."""
        self.ds, self.name, self.size = ds, name, size
        schema = ds.attrs.get(SCHEMA)
        if not isinstance(schema, str) or schema != SCHEMA_VERSION:
            raise StoreError(
                f"path: {name} has the schema {schema!r:.80}, wants {SCHEMA_VERSION!r}; "
                "read it with the version of phasekit that made it, or trace the branch again"
            )
        with damaged(name, "the attribute 'branch'"):
            self.spec = _mapping("branch", json.loads(ds.attrs["branch"]))
            self.made_of = _mapping("problem", self.spec["problem"])

    def problem(self) -> Problem:
        """The problem, if it is one of formulas or of a system."""
        with damaged(self.name, "its problem"):
            name = self.made_of.get("system")
            if name:
                model = model_named("problem", name)
                return Problem.from_system(model(**self.made_of["system_parameters"]))
            kind = BoundaryProblem if "conditions" in self.made_of else Problem
            problem = kind.from_specification(self.made_of)
        if problem is None:
            raise ParameterError(
                "problem: the branch is one of Python or compiled code, which is not saved; "
                "wants the problem itself: Branch.load(path, problem=...)"
            )
        return problem

    def refuse_other(self, problem: Problem) -> None:
        """Raise a `ParameterError` if a given problem is not that of the branch."""
        with damaged(self.name, "its problem"):
            states = [str(name) for name in self.made_of["state"]]
            values = {k: float(v) for k, v in _mapping("", self.made_of["parameters"]).items()}
        if list(problem.state) != states or dict(problem.parameters) != values:
            raise bad("problem", problem, f"the problem of the branch, with {states} and {values}")

    def functions(self, given: Mapping[str, Any]) -> dict[str, Any]:
        """What is recorded: functions by name, None where the name says it."""
        with damaged(self.name, "what it records"):
            kept = _mapping("record", self.spec["record"])
        missing = [name for name, by_name in kept.items() if not by_name and name not in given]
        if missing:
            raise ParameterError(
                f"record: the branch records {', '.join(missing)} by functions, which are not "
                "saved; wants them again: Branch.load(path, record={...})"
            )
        return {name: None if by_name else given[name] for name, by_name in kept.items()}

    def asked(self, problem: Problem, given: Mapping[str, Any] | None) -> dict[str, Any]:
        """The events of the branch and where it ends, with functions that are given again."""
        events = self.events(problem, given, events_of)
        with damaged(self.name, "its events"):
            ends = tuple(str(name) for name in self.spec.get("ends", ()))
            conditions = list(self.spec.get("conditions", ()))
        events = tuple(replace(one, condition=one.name in conditions) for one in events)
        held = None
        if self.spec["kind"] == KINDS[EVENT]:
            found = self.events(problem, given, events_of, "held")
            with damaged(self.name, "its event"):
                (held,) = found
        return {"events": events, "ends": ends, "conservative": problem.conservative,
                "discrete": problem.map, "held": held}  # fmt: skip

    def events(
        self, problem: Problem, given: Mapping[str, Any] | None, take: Callable[..., Any],
        which: str = "events",
    ) -> tuple[Any, ...]:  # fmt: skip
        """The events of the branch, with functions that are given again."""
        with damaged(self.name, "its events"):
            kept = dict(_mapping(which, self.spec.get(which, {})))
        missing = [n for n, text in kept.items() if text is None and n not in (given or {})]
        if missing:
            raise ParameterError(
                f"events: the branch looks for {', '.join(missing)} by functions, which are not "
                "saved; wants them again: Branch.load(path, events={...})"
            )
        code = {n: (given or {})[n] for n, text in kept.items() if text is None}
        for name, function in code.items():
            if not callable(function):
                raise bad(f"events[{name!r}]", function, "the function of the branch")
        with damaged(self.name, "its events"):
            formulas = {
                one.name: one
                for one in take(problem, {n: t for n, t in kept.items() if t is not None})
            }
        functions = {one.name: one for one in take(problem, code)}
        return tuple((formulas | functions)[name] for name in kept)

    def curve(self, problem: Problem) -> Curve:
        """The curve that was traced."""
        with damaged(self.name, "its curve"):
            options = dict(_mapping("options", self.spec["options"]))
            options["detect"] = tuple(options["detect"])
            options["bounds"] = {k: tuple(v) for k, v in options["bounds"].items()}
            kind = NUMBERS[self.spec["kind"]]
            names, free = list(problem.parameters), list(self.spec["free"])
            active = tuple(names.index(name) for name in free)
            count = 1 if kind == EQUILIBRIUM else 2
            if len(set(active)) != count or len(active) != count:
                raise ValueError(f"free: got {free}, wants {count} different parameters")
            empty = np.zeros(0)
            made = Curve(
                problem.field, kind, empty, active, empty, empty, empty, empty,
                ContinuationOptions(**options),
            )  # fmt: skip
            shapes = {name: (made.size,) for name in ARRAYS} | {"par": (len(names),)}
            arrays = {
                name: self.array(f"curve_{name}", shape, finite=name not in ("low", "high"))
                for name, shape in shapes.items()
            }
            if not (arrays["scale"] > 0.0).all() or not (arrays["period"] >= 0.0).all():
                raise ValueError("raw_curve_scale, raw_curve_period: want numbers > 0, and >= 0")
            aux = self.array("curve_aux", (made.n if kind in (HOPF, TORUS) else 0,))
            return made.replace(**arrays, aux=aux if aux.size else None)

    def traces(self, curve: Curve) -> tuple[Sample, tuple[Track | None, Track | None]]:
        """The start, and the tracks in both directions."""
        size, n, m = curve.size, curve.n, curve.m
        with damaged(self.name, "its points"):
            u, tangent = self.array("start_u", (size,)), self.array("start_tangent", (size,))
            start = Sample(u, tangent, self.array("start_slopes", (n, m), finite=False))
            backward, forward = (
                self._track(name, stop, curve)
                for name, stop in zip(("backward", "forward"), self.spec["stops"], strict=True)
            )
        return start, (backward, forward)

    def _track(self, name: str, stop: Any, curve: Curve) -> Track | None:
        if stop is None:
            return None
        size = curve.size
        columns = 2 * size + trace.RECORDED
        state = VECTORS * size + curve.n
        reason, message = stop
        ends = (*_REASONS, *(str(name) for name in self.spec.get("ends", ())))
        if reason not in ends or not isinstance(message, str):
            raise ValueError(f"stops: got {reason!r:.80}, wants one of {', '.join(_REASONS)}")
        # Where f ends, derivatives and the state that is left need not be finite.
        record, slopes = self._points(name, curve, columns)
        left = self.array(f"{name}_state", (state + STATE_NUMBERS,), finite=False)
        if not np.isfinite(record[:, : 2 * size]).all():
            raise ValueError(f"raw_{name}: got points that are not finite")
        return Track(record, slopes, left, Stop(reason, message))

    def _points(self, name: str, curve: Curve, columns: int) -> tuple[Array, Array]:
        """Points and, of few states, the derivatives of f at each."""
        matrix = curve.n * curve.m
        if self.ds.variables[f"raw_{name}"].shape[-1:] != (columns,):
            # Earlier versions kept the derivatives between tangents and step data.
            record = self.array(name, (None, columns + matrix), finite=False)
            here = slice(2 * curve.size, 2 * curve.size + matrix)
            slopes = record[:, here] if curve.keeps else record[:, :0]
            return np.delete(record, here, axis=1), slopes
        record = self.array(name, (None, columns), finite=False)
        if not curve.keeps:
            return record, record[:, :0]
        return record, self.array(f"{name}_slopes", (len(record), matrix), finite=False)

    def array(self, name: str, shape: tuple[int | None, ...], *, finite: bool = True) -> Array:
        """Read an array of doubles of a shape, in which None is any length."""
        name = f"raw_{name}"
        if name not in self.ds.variables:
            raise ValueError(f"{name} is not there")
        there = self.ds.variables[name]
        fits = len(there.shape) == len(shape) and all(
            wants in (None, got) for got, wants in zip(there.shape, shape, strict=True)
        )
        if not fits or there.dtype != np.float64:
            raise ValueError(
                f"{name}: got {there.dtype} of shape {there.shape}, wants float64 of shape "
                f"{tuple('any' if k is None else k for k in shape)}"
            )
        if there.nbytes > max(_SMALL, _RATIO * self.size):
            raise ValueError(f"{name}: got {there.nbytes} bytes in a file of {self.size}")
        values = np.ascontiguousarray(there.values)
        if finite and not np.isfinite(values).all():
            raise ValueError(f"{name}: got numbers that are not finite")
        return values


def _mapping(what: str, value: Any) -> Mapping[str, Any]:
    if not isinstance(value, Mapping):
        raise ValueError(f"{what}: got {value!r:.80}, wants names with values")
    return value
