"""Equations of motion of a mechanical chain: M x'' + C x' + K x + f(x) = forcing."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from phasekit.arrays import Array
from phasekit.labels.arguments import bad, flag, reals, unknown
from phasekit.laws.formulas import symbols_of
from phasekit.numerics.pointwise import pointwise
from phasekit.systems.problem_parts import arrays_of, check_call, expressions_of, names_of
from phasekit.systems.waves import period_in_time

MOST = 4_000  # terms up to which equations of motion are written as formulas
WIDE = 500  # states up to which derivatives are a dense matrix
ALIKE = 1e-12  # part by which entries of a symmetric matrix differ by rounding
SINGULAR = 1e-14  # pivots of M, relative, that are rounding


class Chain(NamedTuple):
    """The parts of equations of motion: matrices, and forces by formulas or functions."""

    M: Any
    C: Any
    K: Any
    states: tuple[str, ...]
    parameters: tuple[str, ...]
    time: str
    force: Mapping[int, Any] | Callable[..., Any]
    forcing: Mapping[int, Any] | Callable[..., Any]
    jac: Callable[..., Any] | None

    @property
    def n(self) -> int:
        """How many coordinates there are."""
        return int(self.M.shape[0])

    @property
    def diagonal(self) -> bool:
        """Whether accelerations are apart from each other."""
        return bool(self.M.count_nonzero() == np.count_nonzero(self.M.diagonal()))

    def solver(self) -> Callable[[Array], Array]:
        """The function that solves M a = b, of a vector or the columns of a matrix."""
        if self.diagonal:
            masses = self.M.diagonal()
            return lambda b: (b.T / masses).T
        from scipy.sparse.linalg import splu

        solve: Callable[[Array], Array] = splu(self.M.tocsc()).solve
        return solve


def equations_of_motion(
    matrices: Mapping[str, Any], force: Any, forcing: Any, parameters: Any, coordinates: Any,
    time: str, period: Any, jac: Any, conservative: Any,
) -> tuple[tuple[Any, ...], dict[str, Any]]:  # fmt: skip
    """What `Problem` takes of a chain, by place and by name."""
    if conservative is not None:
        flag("conservative", conservative)
    M, C, K = (_matrix(name, given) for name, given in matrices.items())
    n = M.shape[0]
    for name, matrix in (("C", C), ("K", K)):
        if matrix.shape != (n, n):
            raise bad(name, matrices[name], f"a matrix of shape ({n}, {n}), as M")
    if coordinates is None:
        coordinates = ["x"] if n == 1 else [f"x{i}" for i in range(1, n + 1)]
    elif isinstance(coordinates, str):
        coordinates = (coordinates,)
    names = names_of("coordinates", coordinates)
    if len(names) != n:
        raise bad("coordinates", coordinates, f"{n} names, as M has {n} rows")
    states = names_of("coordinates", (*names, *(f"d{name}" for name in names)))
    values = arrays_of("parameters", {} if parameters is None else parameters)
    (time,) = names_of("time", (time,))
    for name in values:
        if name in states or name == time:
            raise bad("parameters", list(values), f"other names, as {name!r} is taken")
    if time in states:
        raise bad("time", time, "a name that is no state")
    if jac is not None and not callable(force):
        raise bad("jac", jac, "None unless force is a function")
    force = _forces("force", force, names, [*states, *values], states)
    forcing = _forces("forcing", forcing, names, [*values, time], ())
    chain = Chain(M, C, K, states, tuple(values), time, force, forcing, jac)
    _check_masses(chain, matrices["M"])
    t = symbols_of([time])[time]
    if callable(forcing):
        moved, found = True, None
    else:
        moved = any(t in formula.free_symbols for formula in forcing.values())
        found = period_in_time(forcing.values(), t) if moved else None
    if not moved and period is not None:
        raise bad("period", period, "None where the forcing does not depend on the time")
    more = {"time": time, "period": found if period is None else period} if moved else {}
    code = callable(force) or callable(forcing)
    linear = C.count_nonzero() + K.count_nonzero()
    lossless = not (moved or C.count_nonzero())
    if conservative and not lossless:
        raise bad("conservative", True, "None or False with damping or a forcing that moves")
    if not code and (linear if chain.diagonal else n * n) <= MOST:
        if conservative or conservative is None and lossless and _conserves(chain):
            more["conservative"] = True
        return (_formulas(chain), states, values), more
    motion = Motion(chain)
    for argument, function, given in (
        ("force", force, tuple(values)), ("jac", jac, tuple(values)),
        ("forcing", forcing, tuple(values)),
    ):  # fmt: skip
        if callable(function):
            check_call(argument, function, given)
    known = not callable(force) or jac is not None
    if conservative:
        more["conservative"] = True
    return (motion, states, values, Slopes(motion) if known else None), more


def _matrix(argument: str, given: Any) -> Any:
    """A square matrix of finite numbers, sparse."""
    from scipy.sparse import csr_array, issparse

    wants = "a square matrix of finite numbers, dense or sparse"
    if issparse(given):
        if given.ndim != 2 or given.dtype.kind not in "iuf":
            raise bad(argument, given, wants)
        matrix = csr_array(given, dtype=float)
    else:
        dense = np.atleast_2d(reals(argument, given, wants))
        if dense.ndim != 2:
            raise bad(argument, given, wants)
        matrix = csr_array(dense)
    rows, columns = matrix.shape
    if rows != columns or not rows or not np.isfinite(matrix.data).all():
        raise bad(argument, given, wants)
    matrix.sum_duplicates()
    matrix.eliminate_zeros()
    return matrix


def _check_masses(chain: Chain, given: Any) -> None:
    """Refuse a matrix of masses that cannot be solved with."""
    from scipy.sparse import diags_array
    from scipy.sparse.linalg import splu

    size = abs(chain.M).max(axis=1).toarray().ravel()
    if np.all(size > 0.0):
        if chain.diagonal:
            return
        try:
            pivots = np.abs(splu((diags_array(1.0 / size) @ chain.M).tocsc()).U.diagonal())
        except RuntimeError:  # it is exactly singular
            pivots = np.zeros(1)
        if pivots.min() > SINGULAR * pivots.max():
            return
    raise bad("M", given, "a matrix that is not singular, as accelerations are solved for")


def _forces(
    argument: str, given: Any, names: Sequence[str], known: list[str], states: Sequence[str]
) -> Any:
    """Forces by the places of the coordinates, as formulas; or the function that they are."""
    if callable(given) and not hasattr(given, "free_symbols"):
        return given
    if given is None:
        return {}
    if isinstance(given, Mapping):
        for name in given:
            if name not in names:
                raise unknown(f"{argument}: coordinate", name, names)
        named = dict(given)
    else:
        alone = isinstance(given, str) or hasattr(given, "free_symbols") or np.ndim(given) == 0
        listed = [given] if alone else list(given)
        if len(listed) != len(names):
            raise bad(argument, given, f"{len(names)} formulas, one for each of {', '.join(names)}")
        named = dict(zip(names, listed, strict=True))
    found = expressions_of(named.values(), known, argument, states)
    place = {name: i for i, name in enumerate(names)}
    return {place[name]: e for name, e in zip(named, found, strict=True) if e != 0}


def _formulas(chain: Chain) -> list[Any]:
    """The rates of the coordinates and of their rates."""
    import sympy

    symbols = list(symbols_of(chain.states).values())
    n, solve = chain.n, chain.solver()
    forces = {i: -formula for i, formula in _given(chain.force).items()}
    for i, formula in _given(chain.forcing).items():
        forces[i] = forces.get(i, 0) + formula
    by_state = solve(-np.hstack([chain.K.toarray(), chain.C.toarray()]))
    by_force = solve(np.eye(n)[:, list(forces)])
    accelerations = []
    for row, shares in zip(by_state, by_force, strict=True):
        terms = [_number(row[j]) * symbols[j] for j in np.flatnonzero(row)]
        given = zip(shares, forces.values(), strict=True)
        terms += [_number(share) * formula for share, formula in given if share != 0.0]
        accelerations.append(sympy.Add(*terms))
    return [*symbols[n:], *accelerations]


def _given(forces: Any) -> Mapping[int, Any]:
    """Forces that are formulas."""
    return {} if callable(forces) else forces


def _number(value: float) -> Any:
    """A number of a formula."""
    import sympy

    return sympy.Integer(int(value)) if value == int(value) else sympy.Float(float(value), 17)


def _conserves(chain: Chain) -> bool:
    """Whether forces that are formulas are those of a potential of the coordinates."""
    import sympy

    symbols = list(symbols_of(chain.states).values())
    place = {symbol: i for i, symbol in enumerate(symbols)}
    for matrix in (chain.M, chain.K):
        if abs(matrix - matrix.T).max() > ALIKE * abs(matrix).max():
            return False
    forces = _given(chain.force)
    for i, formula in forces.items():
        by = {place[s]: formula.diff(s) for s in formula.free_symbols & place.keys()}
        for j, slope in by.items():
            if j >= chain.n or (slope - sympy.diff(forces.get(j, 0), symbols[i])).expand() != 0:
                return False
    return True


class Motion:
    """The rates of the coordinates and velocities of a chain, as a function of the state."""

    def __init__(self, chain: Chain) -> None:
        self.chain = chain
        self._prepare()

    def __getstate__(self) -> Chain:
        """Copies and pickles hold the parts alone."""
        return self.chain

    def __setstate__(self, chain: Chain) -> None:
        """Compile anew."""
        self.chain = chain
        self._prepare()

    def __eq__(self, other: object) -> bool:
        """Whether it is of the same matrices and forces."""
        if not isinstance(other, Motion):
            return NotImplemented
        mine, others = self.chain, other.chain
        return mine[3:] == others[3:] and all(
            a.shape == b.shape and not (a != b).count_nonzero()
            for a, b in zip(mine[:3], others[:3], strict=True)
        )

    def __hash__(self) -> int:
        """Hash of the names."""
        return hash((self.chain.states, self.chain.parameters))

    @property
    def __name__(self) -> str:
        """What it is called where a problem is written."""
        return "motion"

    def _prepare(self) -> None:
        chain = self.chain
        self.solve = chain.solver()
        self.force = _compiled(chain.force, chain.states, chain.parameters)
        self.forcing = _compiled(chain.forcing, (chain.time,), chain.parameters)

    def __call__(self, x: Array, **values: float) -> Array:
        """The rates at a state."""
        chain, n = self.chain, self.chain.n
        q, v = x[:n], x[n:]
        load = -(chain.C @ v) - chain.K @ q
        named = {name: values[name] for name in chain.parameters}
        if callable(chain.force):
            load -= np.asarray(chain.force(q.copy(), **named), float)
        elif self.force is not None:
            load[list(chain.force)] -= self.force(x[None], self.numbers(values))[0]
        if callable(chain.forcing):
            load += np.asarray(chain.forcing(values[chain.time], **named), float)
        elif self.forcing is not None:
            time = np.array([[values.get(chain.time, 0.0)]])
            load[list(chain.forcing)] += self.forcing(time, self.numbers(values))[0]
        return np.concatenate([v, self.solve(load)])

    def numbers(self, values: Mapping[str, float]) -> Array:
        """The parameters in their order."""
        return np.array([values[name] for name in self.chain.parameters], float)


@dataclass(frozen=True)
class Slopes:
    """The derivatives of the rates of a chain by the state: sparse where there are many states."""

    motion: Motion

    def __call__(self, x: Array, **values: float) -> Any:
        """The derivatives at a state."""
        from scipy.sparse import block_array, csr_array, eye_array, hstack

        chain = self.motion.chain
        n = chain.n
        stiff = hstack([chain.K, chain.C]).tocsr()
        if callable(chain.force):
            named = {name: values[name] for name in chain.parameters}
            assert chain.jac is not None
            own = csr_array(chain.jac(x[:n].copy(), **named))
            stiff = stiff + hstack([own, csr_array((n, n))])
        elif self.motion.force is not None:
            force = self.motion.force
            found = force.slopes(x[None], self.motion.numbers(values))[0]
            by_state = force.columns < 2 * n
            rows = np.array(list(chain.force))[force.rows[by_state]]
            entries = found[by_state], (rows, force.columns[by_state])
            stiff = stiff + csr_array(entries, shape=(n, 2 * n))
        if chain.diagonal:
            from scipy.sparse import diags_array

            accelerations = diags_array(-1.0 / chain.M.diagonal()) @ stiff
        else:
            accelerations = csr_array(-self.motion.solve(stiff.toarray()))
        kept = block_array([[hstack([csr_array((n, n)), eye_array(n)])], [accelerations]])
        return kept.toarray() if 2 * n <= WIDE else kept.tocsr()


def _compiled(forces: Any, names: tuple[str, ...], parameters: tuple[str, ...]) -> Any:
    """Forces that are formulas as machine code; None where there are none."""
    given = tuple(_given(forces).values())
    return pointwise(given, names, parameters) if given else None
