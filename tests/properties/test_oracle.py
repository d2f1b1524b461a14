"""The reference values of the tests agree with the recorded ones, which have another source."""

from __future__ import annotations

import numpy as np
import pytest
from mpmath import mp, mpf
from properties.extended import derivatives
from properties.strategies import FAMILIES, systems
from witnesses import oracle
from witnesses.variants import some

DIGITS = mpf(10) ** -22


def doubles(case: dict) -> list[float]:
    return [float(case["in"][name]) for name in "ABC"]


def close(got, text: str, scale=0) -> bool:
    with mp.workdps(oracle.DPS):
        return abs(got - mpf(text)) <= DIGITS * max(abs(mpf(text)), abs(mpf(scale)))


def test_equilibria_agree_with_the_recorded_ones():
    for case in oracle.cases("equilibria"):
        A, B, C = doubles(case)
        scale = abs(A) + abs(B) + abs(C)
        points, out = oracle.equilibria(A, B, C), case["out"]
        assert len(points) == oracle.count(A, B, C) == out["n"], case["id"]
        assert oracle.delta_sign(A, B, C) == out["discriminant_sign"], case["id"]
        for want in out["equilibria"]:
            point = min(points, key=lambda p, phi=want["phi"]: oracle.apart(p.phi, phi))
            assert oracle.apart(point.phi, want["phi"]) < DIGITS, case["id"]
            assert point.kind == want["type"], case["id"]
            assert close(point.energy, want["V"], scale), case["id"]
            assert close(point.curvature, want["V2"], scale), case["id"]
        margin = oracle.fold_margin(A, B, C)
        distance = mpf(out["fold_distance"])
        near_zero = margin == 0 and abs(distance) < mpf(10) ** -150
        assert near_zero or margin == -distance or close(-margin, out["fold_distance"]), case["id"]


def test_separatrices_agree_with_the_recorded_ones():
    for case in oracle.cases("separatrix"):
        A, B, C = doubles(case)
        saddles = oracle.separatrices(A, B, C)
        assert len(saddles) == len(case["out"]["saddles"])
        for want in case["out"]["saddles"]:
            s = min(saddles.values(), key=lambda s, phi=want["phi"]: oracle.apart(s.phi, phi))
            assert oracle.apart(s.phi, want["phi"]) < DIGITS, case["id"]
            assert s.loop == {"figure8": "lobes"}.get(want["kind"], want["kind"]), case["id"]
            assert close(s.energy, want["h"], abs(A) + abs(B) + abs(C)), case["id"]
            assert close(s.exponent, want["k"]), case["id"]
            if s.loop == "winding":
                assert close(s.winding_area, want["area_up"]), case["id"]
                continue
            assert close(s.lobe_area[0], want["area_left"]), case["id"]
            assert close(s.lobe_area[1], want["area_right"]), case["id"]
            if s.loop == "lobes":
                assert close(s.turning_offset[0], want["theta_left"]), case["id"]
                assert close(s.turning_offset[1], want["theta_right"]), case["id"]
            else:
                assert close(s.turning_offset[1], want["partner_offset"]), case["id"]


def test_coefficients_agree_with_the_recorded_ones():
    for case in oracle.cases("coefficients"):
        built = oracle.disk(**{name: float(x) for name, x in case["in"].items()})
        # cos(pi/2) cancels in the recorded numbers too
        for name, got in (("A", built.A), ("B", built.B), ("C", built.C), ("Jn2", built.Jn)):
            assert close(got, case["out"][name], mpf(10) ** -20), (case["id"], name)
        assert close(built.mixing, case["out"]["mix"], mpf(10) ** -20), case["id"]


def test_critical_beta_agrees_with_the_recorded_one():
    for case in oracle.cases("fold_beta"):
        got = oracle.critical_disk("beta", **{n: float(x) for n, x in case["in"].items()})
        for slot, name in (
            ("minus", "beta_minus"),
            ("sign_change", "beta_star"),
            ("plus", "beta_plus"),
        ):
            want = case["out"][name]
            assert (got[slot] is None) == (want is None), (case["id"], slot)
            assert want is None or close(got[slot], want), (case["id"], slot)


@pytest.mark.parametrize("family", some(FAMILIES, 2))
def test_discriminant_counts_what_sturm_chains_count(family):
    rng = np.random.default_rng(7)
    for A, B, C in np.array(FAMILIES[family](rng, 40)).T:
        points = oracle.equilibria(A, B, C)
        assert len(points) == oracle.count(A, B, C), (A, B, C)
        degenerate = [p for p in points if p.kind not in ("center", "saddle")]
        assert bool(degenerate) == (oracle.delta_sign(A, B, C) == 0), (A, B, C)
        assert set(oracle.labelled(A, B, C).values()) == set(points), (A, B, C)


def test_extended_derivatives_agree_with_fifty_digits():
    A, B, C = systems(400, seed=3)
    scale = np.exp2(-np.frexp(np.max(np.abs([A, B, C]), axis=0))[1])
    A, B, C = A * scale, B * scale, C * scale
    phi = np.random.default_rng(3).uniform(-np.pi, np.pi, A.size)
    phi[::3] = np.arctan2(C, B)[::3]  # V' nearly cancels where A is small
    phi[::5] *= 1e-9
    first, second, _ = derivatives(A, B, C, phi)
    with mp.workdps(oracle.DPS):
        for i in range(A.size):
            for got, exact in ((first[i], oracle.gradient), (second[i], oracle.curvature)):
                want = exact(A[i], B[i], C[i], phi[i])
                assert abs(mpf(got) - want) <= mpf(2) ** -53 * abs(want) + mpf(10) ** -30
