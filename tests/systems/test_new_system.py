"""A system of the trigonometric law is one class: every function answers for it."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest

import phasekit as pk
from phasekit.laws.trigonometric import named
from phasekit.systems.system import MODELS


@pytest.fixture(scope="module")
def Governor():
    """A bead on a hoop in a wind: A = w^2, B = g/R, C = a/R."""

    class Governor(pk.System):
        R = pk.parameter("m", "radius of the hoop", positive=True)
        w = pk.parameter("s-1", "angular velocity of the hoop")
        wind = pk.parameter("m s-2", "acceleration by the wind", default=0.0)
        g = pk.parameter("m s-2", "acceleration of gravity", default=9.81)

        @staticmethod
        def products(v):
            return v["R"] * v["w"] * v["w"], v["g"], v["wind"], v["R"]

    yield Governor
    del MODELS["Governor"]


@pytest.mark.slow
def test_every_function_takes_it(Governor, tmp_path):
    hoop = Governor(R=0.5, w=7.0, wind=1.0)
    A, B, C = hoop.coefficients()
    assert (A, B, C) == pytest.approx((49.0, 19.62, 2.0), rel=1e-15)
    same = pk.Coefficients(A, B, C)
    for function, arguments in (
        (pk.equilibria, ()), (pk.separatrices, ()), (pk.orbits, (0.3, 0.5)),
        (pk.flow, (0.3, 0.5, [0.0, 9.0])), (pk.potential, (0.3,)), (pk.orbit_families, (5,)),
    ):  # fmt: skip
        got, want = function(hoop, *arguments), function(same, *arguments)
        assert len(want.data_vars)
        for name in want.data_vars:
            np.testing.assert_array_equal(got[name].values, want[name].values)
    fold = pk.critical(hoop, "w").critical_fold.sel(fold="plus").item()
    assert abs(pk.equilibria(hoop.replace(w=fold)).fold_margin.item()) < 1e-13
    atlas = pk.branches(hoop, "w", (0.0, 20.0))
    (special,) = np.flatnonzero(atlas.special_kind.values == "fold")
    assert atlas.special_value.values[special] == pytest.approx(fold, rel=1e-14)
    plane = pk.bifurcation_set(hoop, "w", "wind", xlim=(1, 20), ylim=(-5, 5))
    assert "fold" in plane.curve_kind.values
    eights = pk.figure_eights(hoop, {"w": (1.0, 12.0)})
    at = eights.event_w.values[eights.event_kind.values == "fold"]
    np.testing.assert_allclose(at, [fold], rtol=1e-12)
    branch = pk.continuation(hoop, "w", x0="lower_center", span=(4.0, 12.0))
    phi = pk.equilibria(hoop.replace(w=12.0)).phi.sel(equilibrium="lower_center").item()
    assert branch.points.phi.values[-1] == pytest.approx(phi, abs=1e-12)
    assert len(pk.diagram(hoop, "w", span=(1.0, 12.0))) >= 1
    store = pk.sweep(hoop, w=np.linspace(1, 12, 7), store=tmp_path / "map.zarr", workers=1)
    memory = pk.sweep(hoop, w=np.linspace(1, 12, 7))
    np.testing.assert_array_equal(store.phi.values, memory.phi.values)
    assert memory.isel(w=3).phasekit.system() == hoop.replace(w=memory.w.values[3].item())
    assert pk.open_map(tmp_path / "map.zarr").isel(w=2).phasekit.system().R == 0.5


@pytest.mark.slow
def test_files_of_a_model_that_is_not_imported_say_so(Governor, tmp_path, monkeypatch):
    hoop = Governor(R=0.5, w=7.0, wind=1.0)
    branch = pk.continuation(hoop, "w", x0="lower_center", span=(4.0, 12.0))
    branch.save(tmp_path / "branch.nc")
    ds = pk.sweep(hoop, w=[6.0, 7.0], of="equilibria")
    with monkeypatch.context() as elsewhere:
        elsewhere.delitem(MODELS, "Governor")
        with pytest.raises(pk.StoreError, match="'Governor', .* once its module is imported"):
            pk.Branch.load(tmp_path / "branch.nc")
        given = pk.Branch.load(tmp_path / "branch.nc", problem=branch.problem)
        with pytest.raises(pk.ParameterError, match="'Governor', .* once its module is imported"):
            ds.isel(w=0).phasekit.system()
    assert given == branch == pk.Branch.load(tmp_path / "branch.nc")
    assert ds.isel(w=0).phasekit.system() == hoop.replace(w=6.0)


def test_every_picture_takes_it(Governor):
    hoop = Governor(R=0.5, w=7.0, wind=1.0)
    pk.plot.phase_portrait(hoop)
    pk.plot.potential_well(hoop)
    pk.plot.bifurcation_diagram(pk.branches(hoop, "w", (0.0, 20.0)))
    ds = pk.sweep(hoop, w=np.linspace(1, 12, 5), wind=np.linspace(-1, 1, 4))
    pk.plot.parameter_map(ds, "topology")


@pytest.mark.parametrize(
    ("law", "message"),
    [
        (lambda v: (1, 9.81 * v["l"] ** -1, 0, 1), "power -1: a polynomial has whole powers"),
        (lambda v: (1, v["l"] ** 0.5, 0, 1), "power 0.5: a polynomial has whole powers"),
        (lambda v: (1, 9.81 / v["l"], 0, 1), "multiply all four by what is divided by"),
        (lambda v: (1, v["l"] / v["l"], 0, 1), "multiply all four by what is divided by"),
        (lambda v: (1, v["l"] ** 0.5, 0, 1), "of a root make the parameter"),
        (lambda v: (1, np.sqrt(v["l"]), 0, 1), "pk.Potential takes any formula"),
        (lambda v: (1, np.sin(v["l"]), 0, 1), "TypeError: .*sin.*; wants A N, B N, C N and N as"),
        (lambda v: (1, v["length"], 0, 1), "KeyError: 'length'; wants A N"),
        (lambda v: (1, v["l"], 0), "not enough values to unpack .*; wants A N, B N, C N and N as"),
        (lambda v: (1.0, 2.0, 0.5, 1), "got numbers alone, wants A N"),
        (
            lambda v: (v["l"], v["tilt"][1], v["tilt"][0], 1),
            r"the degrees \[0, 1\] in the sine, cosine and radius of tilt, wants all of one",
        ),
    ],
)
def test_what_is_no_law_is_refused_where_the_class_is_made(law, message):
    fields = {
        "l": pk.parameter("m", "length", positive=True),
        "tilt": pk.parameter("rad", "angle of the plane"),
    }
    with pytest.raises(pk.ParameterError, match=f"products of Odd: .*{message}"):
        type("Odd", (pk.System,), {**fields, "products": staticmethod(law)})


def test_a_law_may_be_divided_by_numbers():
    halves = named("l") * named("l") / 2 + named("g") / 0.5
    assert halves({"l": Fraction(3), "g": Fraction(1)}) == Fraction(13, 2)
