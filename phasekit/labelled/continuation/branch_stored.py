"""What a stored branch says, checked: nothing of a file is trusted before it is used.

Compiled code follows the arrays without looking at their sizes, so each has the shape that the
problem asks for before it goes there.
"""

from __future__ import annotations

import contextlib
import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np
import xarray as xr

from phasekit.arrays import Array
from phasekit.bifurcation.continuation.options import ContinuationOptions
from phasekit.bifurcation.continuation.walk import Stop, Unsearched
from phasekit.bifurcation.special_points import KINDS
from phasekit.errors import ParameterError, StoreError
from phasekit.labelled.continuation.checks import take_recorded
from phasekit.labelled.continuation.recording import recorded_as
from phasekit.labels.arguments import bad
from phasekit.maps.stored_arrays import reason
from phasekit.systems.boundary_problem import BoundaryProblem
from phasekit.systems.identity import SCHEMA, SCHEMA_VERSION
from phasekit.systems.problem import Problem
from phasekit.systems.problem_parts import states_stated
from phasekit.systems.registry import model_named
from phasekit.systems.user_events import REASONS

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
            self.kind = self.spec["kind"]

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
            states = list(self.made_of["state"])
            values = {k: float(v) for k, v in _mapping("", self.made_of["parameters"]).items()}
        if (
            states not in (list(problem.state), states_stated(problem))
            or dict(problem.parameters) != values
        ):
            raise bad("problem", problem, f"the problem of the branch, with {states} and {values}")

    def functions(self, problem: Problem, given: Mapping[str, Any]) -> dict[str, Any]:
        """What is recorded: functions by name, None where the name says it."""
        with damaged(self.name, "what it records"):
            kept = _mapping("record", self.spec["record"])
        missing = [name for name, so in kept.items() if so is False and name not in given]
        if missing:
            raise ParameterError(
                f"record: the branch records {', '.join(missing)} by functions, which are not "
                "saved; wants them again: Branch.load(path, record={...})"
            )
        found: dict[str, Any] = {}
        for name, so in kept.items():
            if isinstance(so, bool):
                argument = f"record[{name!r}]"
                found[name] = None if so else take_recorded(problem, argument, given[name])
                continue
            with damaged(self.name, "what it records"):
                found[name] = recorded_as(so).within(problem, f"record[{name!r}]")
        return found

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

    def ends(self) -> tuple[str, ...]:
        """At what the branch was told to end."""
        return tuple(str(name) for name in self.spec.get("ends", ()))

    def options(self) -> ContinuationOptions:
        """The options of the branch."""
        options = dict(_mapping("options", self.spec["options"]))
        options["detect"] = tuple(options["detect"])
        options["bounds"] = {k: tuple(v) for k, v in options["bounds"].items()}
        return ContinuationOptions(**options)

    def active(self, problem: Problem, counts: Sequence[int]) -> tuple[int, ...]:
        """Places of the free parameters, of which there may be so many."""
        names, free = list(problem.parameters), list(self.spec["free"])
        active = tuple(names.index(name) for name in free)
        if len(set(active)) != len(active) or len(active) not in counts:
            wanted = " or ".join(str(count) for count in counts)
            raise ValueError(f"free: got {free}, wants {wanted} different parameters")
        return active

    def tracks(self, read: Callable[[str, Stop], Any]) -> tuple[Any, Any]:
        """The tracks in both directions, by what reads one of a name that ends so."""
        backward, forward = (
            None if stop is None else read(name, self._stop(*stop))
            for name, stop in zip(("backward", "forward"), self.spec["stops"], strict=True)
        )
        return backward, forward

    def _stop(self, reason: Any, message: Any, *was: Any) -> Stop:
        if was:
            before, words = was
            return Unsearched(*self._words(reason, message), self._stop(before, words))
        return Stop(*self._words(reason, message))

    def _words(self, reason: Any, message: Any) -> tuple[str, str]:
        ends = (*REASONS, *KINDS, *self.ends())
        if reason not in ends or not isinstance(message, str):
            raise ValueError(f"stops: got {reason!r:.80}, wants one of {', '.join(REASONS)}")
        return reason, message

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
