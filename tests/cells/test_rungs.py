"""What two rungs of the ladder of laws both compute, compared: each is the witness of the other."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest
import sympy
import xarray as xr
from witnesses.variants import some

import phasekit as pk
from phasekit.cells import evaluate, request
from phasekit.cells.request import passes_of
from phasekit.cells.states import at_states, pass_from
from phasekit.laws import ladder
from phasekit.laws.ladder import Conservative, Flow, Law, Routhian, Standing
from phasekit.laws.trigonometric import Trigonometric
from phasekit.systems.registry import models
from phasekit.table.quantities import ROWS, TABLE
from phasekit.table.row import Pass, Quantity

SYSTEMS = (
    pk.Coefficients(1.0, 0.35, 0.12),
    pk.GyroRotorDisk(beta=0.7, e=0.05, a=0.024, r=0.2, omega1=31.4),
    pk.StonerWohlfarth(K=1.0, h_x=0.3, h_y=0.2),
    pk.Pendulum(length=0.5, g=10.0),
)
STATES = {
    "state_phi": [0.3, -1.2, 2.5], "state_dphi": [0.1, 0.0, -4.0], "state_energy": [1.0, 2.0, 3.0],
    "state_gap": [-0.01, 0.02, 0.3], "state_excess": [0.0, 0.01, 0.3], "time": [0.0, 0.7, 5.0],
    "state_action": [], "state_angle": [], "state_family": [],  # those of orbits of each system
}  # fmt: skip
CHOICES = {"center": None, "saddle": None, "side": "right"}


#: Each way on which two rungs compute the same: groups, what they start from, what a call says.
def shared(general, special):
    ways = (
        {
            (one.groups, tuple(x for x in one.inputs if x in STATES), one.options)
            for one in TABLE.passes
            if one.of == rung
        }
        for rung in (general, special)
    )
    return sorted(set.intersection(*ways))


SHARED = shared(Conservative, Trigonometric)
#: The same of perturbed systems, and what they are perturbed by.
PERTURBED = [
    way
    for way in shared(*(Standing(rung, ladder.PERTURBED) for rung in (Conservative, Trigonometric)))
    if way[0] != ("quiet_frequencies",)  # of which a call says how many
]
DRIVES = {
    "melnikov": {"damping": 0.01, "torque": 0.002, "forcing": pk.Harmonic(0.02, 1.3, 0.4)},
    "capture": {"damping": 0.01, "quadratic": 0.02},
    "retrapping": {"damping": 0.01, "quadratic": 0.02},
    "critical_torques": {"damping": 0.1, "torque": 0.02},
}


def as_potential(system):
    """The same law one rung lower: any potential."""
    law = system.trigonometric()
    symbols = {name: sympy.Symbol(name, real=True) for name in law.domains}
    A, B, C = law.formulas(symbols)
    phi = sympy.Symbol("phi", real=True)
    V = -B * sympy.cos(phi) + A / 2 * sympy.cos(phi) ** 2 - C * sympy.sin(phi)
    values = {name: system.parameters[name] for name in law.parameters}
    V = V.subs({symbols[name]: sympy.Float(value, 17) for name, value in values.items()})
    return pk.Potential(V, "phi", {}, period=2 * np.pi)


def test_every_rung_below_is_reached():
    assert len(SHARED) >= 12
    groups = {group for groups, _, _ in SHARED for group in groups}
    assert {"equilibria", "separatrices", "orbits", "motion", "potential", "near_center"} <= groups


@pytest.mark.parametrize(("way", "system"), some(itertools.product(SHARED, SYSTEMS), 3))
def test_the_rungs_agree(system, way):
    groups, needed, options = way
    rows = [row for row in ROWS.values() if row.group in groups]
    # By which labels are put in order.
    places = [ROWS["phi"]] if groups == ("near_center",) else []
    results = []
    for one in (system, as_potential(system)):
        own = {**STATES, **places_on_orbits(system, one)} if "state_action" in needed else STATES
        states = {name: (name, own[name]) for name in needed}
        if options:
            chosen = {name: CHOICES[name] for name in options}
            passes = (pass_from(one, groups[0], needed[-1], **chosen)[0],)
        else:
            passes = passes_of(one, [*places, *rows])
        results.append(in_order(at_states(one, [*places, *rows], states, passes)))
    assert_same([row for row in rows if row.of is Law], *results)


def places_on_orbits(system, one):
    """Actions and angles of states, by closed forms, and families by the codes of a rung."""
    found = pk.action_angle(system, STATES["state_phi"], STATES["state_dphi"])
    families = found.orbit_family.values
    if one is not system:
        points = pk.equilibria(one)
        centers = np.flatnonzero(points.kind.values == pk.EquilibriumKind.CENTER)
        lower, upper = centers[np.argsort(points.energy.values[centers])][[0, -1]]
        wells = (1 << int(lower), 1 << int(upper))
        codes = dict(zip((1, 2, 3, 4, 5), (*wells, sum(wells), -1, -2), strict=True))
        families = np.array([codes[code] for code in families])
    return {
        "state_action": found.action.values,
        "state_angle": found.angle.values,
        "state_family": families,
    }


def assert_same(rows, exact, numerical):
    assert rows
    for row in rows:
        a, b = (ds[row.name].values.astype(float) for ds in (exact, numerical))
        assert a.shape == b.shape, row.name
        if row.units == "rad":
            a, b = (np.exp(1j * x) for x in (a, b))
        # An estimate of an error needs no more digits: one has slopes, the other differences.
        near = 1e-3 if row.name == "chaos_threshold_error" else 2e-11
        np.testing.assert_allclose(b, a, rtol=near, atol=2e-11, err_msg=row.name)
    assert exact.sizes == numerical.sizes


@pytest.mark.parametrize("way", PERTURBED, ids=lambda w: "-".join(w[0]))
def test_the_rungs_of_perturbed_systems_agree(way):
    groups, needed, options = way
    assert (needed, options) == ((), ())
    # Saddles of both are in the order of their angles.
    base = pk.Coefficients(1.0, 0.35, -0.12)
    rows = [row for row in ROWS.values() if row.group in groups and row.of is not Trigonometric]
    rows = [row for row in rows if row.of != Standing(Trigonometric, ladder.PERTURBED)]
    results = [
        at_states(pk.Perturbed(one, **DRIVES[groups[0]]), rows, {})
        for one in (base, as_potential(base))
    ]
    assert_same(rows, *results)


ANY = pk.Potential(
    "A*cos(phi)^2/2 - B*cos(phi) - C*sin(phi)", "phi", {"A": 1.0, "B": 0.35, "C": -0.12}, "2*pi"
)


@pytest.mark.parametrize(("parameter", "C"), [("A", -0.12), ("B", -0.12), ("A", 0.0), ("C", 0.3)])
def test_critical_values_and_branches_are_the_exact_ones(parameter, C):
    """The same folds, pitchforks and normal forms; the same branches, seen at some values."""
    span = (-1.5, 1.6)
    exact, boxes = pk.Coefficients(1.0, 0.35, C), ANY.replace(C=C)
    folds = [pk.critical(one, parameter, span) for one in (exact, boxes)]
    ways = [pk.branches(one, parameter, span) for one in (exact, boxes)]
    for found in (*folds, *ways):
        assert found.complete
    wanted, got = folds
    assert got.sizes == wanted.sizes
    np.testing.assert_array_equal(got.critical_fold_kind, wanted.critical_fold_kind)
    apart = abs(got.critical_fold - wanted.critical_fold)
    assert (apart <= 2.0 * (got.critical_fold_error + wanted.critical_fold_error)).all()
    merged = [ds.isel(special=(ds.special_kind != "end").values) for ds in ways]
    for name in ("special_value", "unfolding", "quadratic", "cubic"):
        np.testing.assert_allclose(merged[1][name], merged[0][name], rtol=1e-11, atol=1e-12)
    np.testing.assert_array_equal(merged[1].special_kind, merged[0].special_kind)
    turn = np.exp(1j * merged[1].special_phi.values) / np.exp(1j * merged[0].special_phi.values)
    np.testing.assert_allclose(turn, 1.0, rtol=1e-12)
    assert ways[1].sizes["branch"] == ways[0].sizes["branch"]
    for value in np.linspace(*span, 9)[1:-1]:
        through = [crossings(ds, parameter, value) for ds in ways]
        np.testing.assert_allclose(through[1], through[0], atol=2e-3)


def test_bifurcation_sets_are_the_exact_ones():
    box = {"xlim": (-1.5, 1.5), "ylim": (-1.4, 1.6)}
    exact, boxes = (
        pk.bifurcation_set(one, "B", "C", **box) for one in (pk.Coefficients(1.0, 0.3, 0.2), ANY)
    )
    assert boxes.complete
    np.testing.assert_array_equal(boxes.curve_kind, exact.curve_kind)
    np.testing.assert_array_equal(boxes.closed, exact.closed)
    order = [
        np.lexsort((ds.cusp_C.values.round(9), ds.cusp_B.values.round(9))) for ds in (exact, boxes)
    ]
    for name in ("cusp_B", "cusp_C", "cusp_cubic", "cusp_like"):
        one, other = (ds[name].values[rows] for ds, rows in zip((exact, boxes), order, strict=True))
        if name == "cusp_like":
            np.testing.assert_array_equal(other, one)
        else:
            np.testing.assert_allclose(other, one, atol=1e-12)
    astroid = boxes.isel(curve=0).dropna("point")
    level = abs(astroid.B) ** (2 / 3) + abs(astroid.C) ** (2 / 3)
    np.testing.assert_allclose(level, 1.0, rtol=1e-9)
    np.testing.assert_allclose(
        astroid.quadratic, -1.5 * np.sin(astroid.phi) * np.cos(astroid.phi), atol=1e-12
    )
    for row in (1, 2):  # along B = 0 and C = 0, from cusp to cusp
        for name in ("B", "C"):
            one, other = (ds[name].isel(curve=row).values for ds in (exact, boxes))
            for end in (np.nanmin, np.nanmax):
                assert end(other) == pytest.approx(end(one), abs=1e-9)


EXACT = pk.Coefficients(1.0, 0.35, -0.12)
DRIVEN = {"damping": 0.01, "forcing": pk.Harmonic(0.02, 1.3, 0.4)}


def numbered_centers(torque):
    """Numbers, among the equilibria of any potential, of those that the exact rung names."""
    exact, boxes = (pk.equilibria(pk.Perturbed(one, torque=torque)) for one in (EXACT, ANY))
    names = ("lower_center", "upper_center")
    apart = abs(boxes.phi.values - exact.phi.sel(equilibrium=list(names)).values[:, None])
    return {name: int(number) for name, number in zip(names, apart.argmin(axis=1), strict=True)}


@pytest.mark.parametrize("torque", [pytest.param(0.0, marks=pytest.mark.slow), 0.05])
def test_resonances_are_the_exact_ones(torque):
    """Actions and widths of all families; under a torque nothing rotates."""
    lower, upper = numbered_centers(torque).values()
    families = {
        "lower_well": f"well_{lower}", "upper_well": f"well_{upper}",
        "outer": f"wells_{min(lower, upper)}_{max(lower, upper)}",
        "forward": "forward", "backward": "backward",
    }  # fmt: skip
    for family, name in families.items():
        exact = pk.resonances(pk.Perturbed(EXACT, torque=torque, **DRIVEN), n=3, family=family)
        boxes = pk.resonances(pk.Perturbed(ANY, torque=torque, **DRIVEN), n=3, family=name)
        np.testing.assert_allclose(boxes.resonance_action, exact.resonance_action, rtol=1e-12)
        np.testing.assert_allclose(boxes.resonance_width, exact.resonance_width, rtol=1e-8)
        there = torque == 0.0 or "well" in name
        assert exact.resonance_action.notnull().any() == there
    wave = {"modulation": {"B": pk.Harmonic(0.02, 1.3)}}
    exact, boxes = (pk.resonances(pk.Perturbed(one, **wave), n=3) for one in (EXACT, ANY))
    assert boxes.resonance_width.attrs["family"] == "the well of the lowest center"
    np.testing.assert_allclose(boxes.resonance_width, exact.resonance_width, rtol=1e-8)


def test_quiet_frequencies_and_retrapping_are_the_exact_ones():
    exact = pk.quiet_frequencies(pk.Perturbed(EXACT, **DRIVEN), n=4).quiet_frequency
    ds = pk.quiet_frequencies(pk.Perturbed(ANY, **DRIVEN), n=4)
    boxes = ds.quiet_frequency
    eights = exact.notnull().any(("side", "order")).values
    inner = boxes.notnull().any(("side", "order")).values
    assert eights.sum() == inner.sum() == 1
    error = ds.quiet_frequency_error.values[inner]
    off = abs(boxes.values[inner] - exact.values[eights])
    assert (np.isfinite(error).sum(axis=-1) >= 3).all()
    assert (off <= error + 1e-13)[np.isfinite(error)].all()
    for damping in ({"damping": 0.01}, {"damping": 0.2, "quadratic": 0.1}):
        pair = [pk.retrapping_torque(pk.Perturbed(one, **damping)) for one in (EXACT, ANY)]
        for name in pair[0]:
            np.testing.assert_allclose(pair[1][name], pair[0][name], rtol=1e-12)
    with pytest.raises(pk.ParameterError, match="wants a coordinate with a period"):
        pk.retrapping_torque(pk.Perturbed(pk.Potential("x^4 - x^2", "x"), damping=0.1))


@pytest.mark.parametrize("torque", [0.0, 0.05])
def test_escape_is_the_exact_one(torque):
    """Over the lower saddle, and then over the higher one out of both wells."""
    warm = {"damping": [0.02, 0.2, 3.0], "kT": 0.02, "torque": torque}
    loops = [pk.separatrices(pk.Perturbed(one, torque=torque)) for one in (EXACT, ANY)]
    order = abs(loops[1].saddle_phi.values - loops[0].saddle_phi.values[:, None]).argmin(axis=1)
    for name, number in numbered_centers(torque).items():
        exact = pk.escape_rate(pk.Perturbed(EXACT, **warm), center=name)
        boxes = pk.escape_rate(pk.Perturbed(ANY, **warm), center=number).isel(saddle=order)
        assert exact.escape_rate.notnull().sum() >= 6
        for quantity in exact:
            np.testing.assert_allclose(
                boxes[quantity], exact[quantity].values, rtol=1e-6, err_msg=quantity
            )


def crossings(ds, parameter, value):
    """Angles at which branches pass a value of the parameter, about so."""
    found = []
    for k in range(ds.sizes["branch"]):
        at, phi = (ds[name].isel(branch=k).values for name in (parameter, "phi"))
        for i in np.flatnonzero((at[:-1] - value) * (at[1:] - value) < 0.0):
            part = (value - at[i]) / (at[i + 1] - at[i])
            found.append(np.mod(phi[i] + part * (phi[i + 1] - phi[i]) + 0.1, 2.0 * np.pi))
    return np.sort(found)


def in_order(ds):
    """Label dims without names, in the order of the angle; absent labels left out."""
    for dim, name in (("equilibrium", "phi"), ("saddle", "saddle_phi")):
        if dim in ds.dims and name in ds:
            order = np.argsort(ds[name].values)
            order = order[np.isfinite(ds[name].values[order])]
            ds = ds.isel({dim: order}).drop_vars(dim)
    return ds


def test_a_quantity_of_a_higher_rung_is_refused_below():
    potential = as_potential(SYSTEMS[0])
    with pytest.raises(pk.ParameterError, match=r"wants a system with coefficients \(A, B, C\)"):
        pk.near_separatrix(potential, 0.1)
    assert "fold_margin" not in pk.equilibria(potential)


def test_rungs_are_the_only_thing_that_systems_are_asked_for():
    rungs = {model.rung for model in models().values()}
    assert rungs <= {Trigonometric, Conservative, Routhian, Flow}
    assert isinstance(pk.equilibria(SYSTEMS[1]), xr.Dataset)


def barrier(saddle_energy, energy):
    return np.nanmax(saddle_energy, axis=-1) - np.nanmin(energy, axis=-1)


def test_what_a_row_starts_from_is_that_of_the_same_rung(monkeypatch):
    """A torque changes energies: what is computed from them is computed from these."""
    row = Quantity("barrier", "barrier", (), "float64", "s-2", "barrier", "h_s - V", "-")
    twice = replace(row, name="twice", group="twice")
    monkeypatch.setattr(TABLE, "rows", {**ROWS, "barrier": row, "twice": twice})
    lines = (
        Pass(barrier, ("saddle_energy", "energy"), ("barrier",), of=Law),
        Pass(lambda barrier: 2.0 * barrier, ("barrier",), ("twice",), of=Law),
    )
    monkeypatch.setattr(TABLE, "passes", (*TABLE.passes, *lines))
    monkeypatch.setattr(request, "ROWS", TABLE.rows)
    tilted = pk.Perturbed(pk.Coefficients(4.0, 1.0, 0.5), torque=0.2)
    as_formula = pk.Potential(
        "-cos(q) + a*cos(q)^2/2 - sin(q)/2", "q", {"a": 4.0}, period=2 * np.pi
    )  # fmt: skip
    A = np.array([4.0, 4.4, 4.8])
    of = [row, twice]
    for system, axis in ((tilted, "A"), (pk.Perturbed(as_formula, torque=0.2), "a")):
        swept = system.replace(**{axis: A})
        known = pk.equilibria(swept).merge(pk.separatrices(swept), compat="override")
        wanted = known.saddle_energy.max("saddle") - known.energy.min("equilibrium")
        found = evaluate.evaluate(swept, of)
        np.testing.assert_allclose(found.barrier, wanted, rtol=1e-13)
        np.testing.assert_array_equal(found.twice, 2.0 * found.barrier)
    chunked = xr.DataArray(A, dims="A").chunk({"A": 2})
    lazy = evaluate.evaluate(tilted.replace(A=chunked), of)
    assert lazy.barrier.chunks is not None
    first = pk.separatrices(tilted).saddle_energy.max() - pk.equilibria(tilted).energy.min()
    np.testing.assert_allclose(lazy.barrier[0], first, rtol=1e-13)
    with pytest.raises(pk.ParameterError, match="without damping and drive .* for separatrices"):
        evaluate.evaluate(tilted.replace(damping=0.1), of)
