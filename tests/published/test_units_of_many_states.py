"""Units and origins of states, parameters and f change no verdict on discretised equations."""

from __future__ import annotations

import os
from collections import Counter

import numpy as np
import pytest
from published import bratu
from published import discretised as pde

import phasekit as pk

ALL = "PHASEKIT_PATHS" in os.environ
DRAWS = 12 if ALL else 1
N = 4


def reactor(u, p):
    """A stirred reactor whose derivative by p changes within 1e-13 of p = 0."""
    (x,) = u
    return np.array([-0.9 - (1 + p) * x + 10 * p / (1 + 10 * p * np.exp(-3 * x / (1 + x)))])


def prey(u, p):
    """Beyond the last branch point p falls like exp(5 x)."""
    x, y = u
    return np.array([3 * x * (1 - x) - x * y - p * (1 - np.exp(-5 * x)), -y + 3 * x * y])


# f, start, from and to of p, bounds of states; and what is on the branch beside neutral saddles.
CASES = {
    "reactor": (reactor, [-0.9], (0.0, 2.0), {}, {"fold": 2}),
    "prey": (prey, [0.8, 0.0], (0.0, 2.0), {0: (-1.5, 2.0)}, {"fold": 1, "transcritical": 2}),
    "bratu": (bratu.bratu, np.zeros(6), (0.0, 4.0), {3: (-1.0, 6.0)}, {"fold": 1}),
    "allen-cahn": (pde.allen_cahn, np.zeros(N), (5.0, 40.0), {}, {"pitchfork": 2}),
    "swift-hohenberg": (pde.swift_hohenberg, np.zeros(N), (0.01, 0.75), {}, {"pitchfork": 2}),
    "brusselator": (pde.brusselator, np.zeros(2 * N), (2.6, 5.6), {},
                    {"pitchfork": 1, "transcritical": 1, "hopf": 1}),
}  # fmt: skip


def follow(name, size=1.0, width=1.0, rate=1.0, origin=0.0, zero=0.0):
    """The branch of a case with states, p and time in other units, from other origins."""
    f, start, (low, high), bounds, _ = CASES[name]
    start = np.array(start)

    def function(u, p):
        return rate * size * f(u / size - origin, p / width - zero)

    states = tuple(f"u{i}" for i in range(len(start)))
    first = 0.5 if name == "prey" else low
    options = pk.ContinuationOptions(
        bounds={f"u{i}": tuple((v + origin) * size for v in pair) for i, pair in bounds.items()}
    )
    return pk.continuation(
        pk.Problem(function, states, {"p": (first + zero) * width}), "p",
        x0=(start + origin) * size, span=((low + zero) * width, (high + zero) * width),
        options=options,
    )  # fmt: skip


# What Allen and Cahn's equation shows, Swift and Hohenberg's does.
@pytest.mark.parametrize("name", [name for name in CASES if ALL or name != "allen-cahn"])
def test_units_change_no_verdict(name):
    rng = np.random.default_rng([len(name), 3])

    def verdict(branch):
        points = branch.special_points
        assert {one.status for one in points} == {"converged"}, branch
        return Counter(one.kind for one in points)

    plain = verdict(follow(name))
    neutral = plain["neutral_saddle"]
    assert plain == Counter(CASES[name][4]) + Counter(end=2, neutral_saddle=neutral)
    for _ in range(DRAWS):
        units = [10.0 ** int(k) for k in rng.integers(-12, 13, 3)]
        origins = rng.choice([0.0, 3.0, -40.0], 2).tolist()
        assert verdict(follow(name, *units, *origins)) == plain, (units, origins)


@pytest.mark.parametrize("origin", [1e3, 1e4])
def test_far_from_the_origin(origin):
    """Differences over steps that suit the motion of a state, not its distance from 0."""
    assert [one.kind for one in follow("prey", origin=origin).special_points] == [
        one.kind for one in follow("prey").special_points
    ]


@pytest.mark.parametrize("gap", [0.004, 0.0004])
def test_neutral_saddles_of_one_step_are_all_found(gap):
    """Eigenvalues p and -(1/2 + k gap): their sums vanish one after the other."""
    f = ["p*x - x**3", *(f"-({0.5 + k * gap!r})*y{k} - y{k}**3" for k in range(4))]
    states = ("x", *(f"y{k}" for k in range(4)))
    branch = pk.continuation(
        pk.Problem(f, states, {"p": 0.1}), "p", x0=np.zeros(5), span=(0.1, 1.0)
    )
    found = [one["p"] for one in branch.special("NS")]
    np.testing.assert_allclose(found, 0.5 + gap * np.arange(4), rtol=1e-10)
