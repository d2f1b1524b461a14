"""Figure-eights along a path, on both rungs: each is the witness of the other."""

import numpy as np
import pytest

import phasekit as pk

V = "-B*cos(x) + A*cos(x)^2/2 - C*sin(x)"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("values", "path"),
    [
        ({"A": 1.0, "B": 0.3, "C": 0.2}, {"A": (0.2, 2.0)}),  # a fold, at which the eight is born
        ({"A": 1.0, "B": 0.2, "C": 0.1}, {"C": (-0.4, 0.5), "B": (0.2, 0.3)}),
        ({"A": -1.0, "B": 0.1, "C": 0.3}, {"C": (0.4, -0.3)}),  # two saddles pass one another
    ],
)
def test_events_of_a_formula_are_those_of_the_closed_form(values, path):
    exact = pk.figure_eights(pk.Coefficients(**values), path, n=41)
    formula = pk.Potential(V, "x", values, period="2*pi")
    found = pk.figure_eights(formula, path, n=41)
    assert found.sizes["event"] == exact.sizes["event"] > 0
    for name in ("event_kind", "event_change"):
        assert found[name].values.tolist() == exact[name].values.tolist()
    np.testing.assert_allclose(found.event_path, exact.event_path, rtol=0, atol=2e-13)
    np.testing.assert_array_equal(found.figure_eight, exact.figure_eight)


@pytest.mark.slow
def test_the_eight_of_a_double_well_is_born_at_its_pitchfork():
    well = pk.Potential("x^4/4 - mu*x^2/2 + t*x", "x", {"mu": 1.0, "t": 0.0})
    ds = pk.figure_eights(well, {"mu": (-0.7, 1.0)}, n=30)
    assert (ds.event_kind.values.tolist(), ds.event_change.values.tolist()) == (["fold"], ["birth"])
    assert ds.event_mu.item() == pytest.approx(0.0, abs=1e-12)
    # Tilted, its one saddle goes where 4 mu^3 = 27 t^2; lobes to both sides are an eight.
    ds = pk.figure_eights(well.replace(mu=1.5), {"t": (0.0, 1.0)}, n=30)
    assert ds.event_t.values == pytest.approx([np.sqrt(4.0 * 1.5**3 / 27.0)], abs=1e-12)
    assert ds.event_change.values.tolist() == ["death"]


@pytest.mark.slow
def test_the_hoop_with_a_spring_of_natural_length():
    hoop = pk.Potential(
        "-9.81*cos(x) - spin^2*sin(x)^2/2 + k*(sqrt(5/4 - cos(x)) - free)^2/2",
        "x", {"spin": 4.0, "k": 10.0, "free": 0.5}, period="2*pi",
    )  # fmt: skip
    ds = pk.figure_eights(hoop, {"spin": (1.0, 12.0)})
    # At 0 the spring is slack: V'' = 9.81 - spin^2.
    assert ds.event_spin.values == pytest.approx([np.sqrt(9.81)], abs=1e-12)
    assert ds.event_change.values.tolist() == ["birth"]
