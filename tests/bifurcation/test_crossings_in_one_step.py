"""Eigenvalues that cross the axis within one step, at places that are known."""

import numpy as np
import pytest

import phasekit as pk


def special(f, at):
    branch = pk.continuation(
        pk.Problem(f, parameters={"p": 0.0}), "p", x0=np.zeros(len(f)), span=(0.0, 1.0)
    )
    kinds = {"hopf": "hopf", "pitchfork": "crossing", "branch_point": "crossing"}
    found = [one for one in branch.special_points if one.kind in kinds]
    assert all(one.status == "converged" for one in found)
    got = sorted((one["p"], kinds[one.kind]) for one in found)
    assert [kind for _, kind in got] == [kind for _, kind in sorted(at)]
    assert np.allclose([p for p, _ in got], [p for p, _ in sorted(at)], rtol=0.0, atol=1e-9)


def system(growths):
    """Decoupled unknowns x' = g x - x^3, and pairs (g, w) that turn with w."""
    f = {}
    for k, (growth, turns) in enumerate(growths):
        if turns:
            f[f"x{k}"] = f"({growth})*x{k} - {turns}*y{k} - x{k}^3"
            f[f"y{k}"] = f"({growth})*y{k} + {turns}*x{k} - y{k}^3"
        else:
            f[f"x{k}"] = f"({growth})*x{k} - x{k}^3"
    return f


def places(seed):
    rng = np.random.default_rng(seed)
    count = int(rng.integers(2, 6))
    near = np.sort(rng.choice(np.arange(-20, 21), count, replace=False)) * 1e-3
    return rng, rng.uniform(0.15, 0.85) + near


@pytest.mark.parametrize("seed", range(8))
def test_all_that_cross_within_a_step_are_found(seed):
    rng, at = places(seed)
    growths, known = [], []
    for place in at.tolist():
        turns = float(rng.uniform(0.5, 3.0)) if rng.random() < 0.4 else 0.0
        growths.append((f"{rng.choice([-1, 1])}*(p - {place!r})", turns))
        known.append((place, "hopf" if turns else "crossing"))
    special(system(growths), known)


@pytest.mark.parametrize("turns", [0.0, 2.0])
@pytest.mark.parametrize(("place", "width", "beside"), [
    (0.6897, 0.0032, 0.7091), (0.6369, 0.0014, 0.6179), (0.2795, 0.0023, None),
    (0.6306, 0.0096, 0.6479),
])  # fmt: skip
def test_one_that_crosses_and_returns_is_found_twice(place, width, beside, turns):
    growths = [(f"-16*(p - {place!r})*(p - {place + width!r})", turns)]
    kind = "hopf" if turns else "crossing"
    known = [(place, kind), (place + width, kind)]
    if beside:
        growths.append((f"p - {beside!r}", 0.0))
        known.append((beside, "crossing"))
    else:
        growths.append(("-1 - p", 0.0))
    special(system(growths), known)


def test_rotated_states_cross_where_others_do():
    """(p - .3), (.305 - p), (p - .31) on axes that are turned."""
    q, _ = np.linalg.qr(np.array([[2.0, 1.0, 0.5], [-1.0, 3.0, 1.0], [0.3, -0.7, 2.0]]))
    names = ("x", "y", "z")
    along = [
        "(" + " + ".join(f"({q[i, k]:.17g})*{names[i]}" for i in range(3)) + ")" for k in range(3)
    ]
    growths = ("p - 0.3", "0.305 - p", "p - 0.31")
    rates = [f"({g})*{u} - {u}^3" for g, u in zip(growths, along, strict=True)]
    f = {
        name: " + ".join(f"({q[i, k]:.17g})*({rates[k]})" for k in range(3))
        for i, name in enumerate(names)
    }
    special(f, [(0.3, "crossing"), (0.305, "crossing"), (0.31, "crossing")])
