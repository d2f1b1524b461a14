"""Units and origins of states, parameters and f change no verdict."""

from __future__ import annotations

import os

import numpy as np
import pytest

import phasekit as pk

DRAWS = 12 if os.environ.get("PHASEKIT_PATHS") else 2

# f, start, from and to of the parameter; and what is on the branch.
CASES = {
    "cubic": (["p + x - x**3"], [-1.4], (-1.0, 1.0), ["fold", "fold"]),
    "pitchfork": (["p*x - x**3"], [0.0], (-1.0, 1.0), ["pitchfork"]),
    "transcritical": (["p*x - x**2"], [0.0], (-1.0, 1.0), ["transcritical"]),
    "brusselator": (["1 - (1 + p)*x + x**2*y", "p*x - x**2*y"], [1.0, 1.0], (1.0, 3.0), ["hopf"]),
    "corank two": (["p*x - x**3 - x*y**2/2", "p*y - y**3 - x**2*y/2"], [0.0, 0.0], (-1.0, 1.0),
                   ["branch_point"]),
}  # fmt: skip


def units(rng):
    """Powers of ten from 1e-12 to 1e12, and origins some units away."""
    sizes = [10.0 ** int(k) for k in rng.integers(-12, 13, 5)]
    origins = rng.choice([0.0, 3.0, -40.0], 3).tolist()
    return sizes, origins


def follow(name, form, sizes, origins):
    """The branch of a case whose x, y and p are measured in other units from other origins."""
    f, start, (low, high), _ = CASES[name]
    names = ["x", "y", "p"]
    of = {key: origin * size for key, origin, size in zip(names, origins, sizes, strict=False)}
    by = dict(zip(names, sizes, strict=False))
    states = names[: len(f)]
    rows = sizes[3:]
    if "hopf" in CASES[name][3]:  # eigenvalues are those of a motion: only time has a unit
        rows = [sizes[3] * by[key] for key in states]
    parameters = {"p": low * by["p"] + of["p"]}
    if form == "formula":
        old = {key: f"(({key} - ({of[key]!r}))/{by[key]!r})" for key in names}
        right = []
        for text, size in zip(f, rows, strict=False):
            new = "".join(old.get(letter, letter) for letter in text)
            right.append(f"{size!r}*({new})")
        problem = pk.Problem(right, state=states, parameters=parameters)
    else:
        code = [compile(text, name, "eval") for text in f]

        def function(u, p):
            here = {"p": (p - of["p"]) / by["p"]}
            here |= {key: (u[i] - of[key]) / by[key] for i, key in enumerate(states)}
            return [size * eval(one, {}, here) for one, size in zip(code, rows, strict=False)]

        problem = pk.Problem(function, state=states, parameters=parameters)
    x0 = [value * by[key] + of[key] for key, value in zip(states, start, strict=True)]
    span = tuple(value * by["p"] + of["p"] for value in (low, high))
    return pk.continuation(problem, "p", x0=x0, span=span)


@pytest.mark.parametrize("form", ["formula", "function"])
@pytest.mark.parametrize("name", CASES)
def test_units_change_no_verdict(name, form):
    rng = np.random.default_rng([len(name), len(form)])

    def verdict(branch):
        return [(one.kind, one.corank, one.status) for one in branch.special_points]

    plain = verdict(follow(name, form, [1.0] * 5, [0.0] * 3))
    assert [kind for kind, _, _ in plain] == ["end", *CASES[name][3], "end"]
    assert {status for _, _, status in plain} == {"converged"}
    for _ in range(DRAWS):
        chosen = units(rng)
        assert verdict(follow(name, form, *chosen)) == plain, chosen
