"""Shares of basins on maps of parameters, against basins one by one."""

from __future__ import annotations

import numpy as np
import pytest

import phasekit as pk
from phasekit.cells import progress
from phasekit.motion.attractors import TOO_WEAK, find
from phasekit.motion.lost import EXHAUSTED, FAILED
from phasekit.motion.shares import SIDE, SLOTS

EIGHT = pk.Coefficients(1.0, 0.35, 0.12)
DRIVEN = pk.Perturbed(EIGHT, damping=0.3, forcing=pk.Harmonic(0.1, 1.0))
BOX = {"box_phi": np.pi, "box_dphi": 2.0}


@pytest.mark.slow
def test_shares_on_a_map_are_those_of_each_system(tmp_path):
    amplitudes = [0.0, 0.2, 0.6]
    store, chunks = tmp_path / "map.zarr", {"forcing_amplitude": 1}
    first = pk.sweep(
        DRIVEN, forcing_amplitude=amplitudes[:2], of="n_attractors", store=store, chunks=chunks,
        **BOX,
    )  # fmt: skip
    assert first.n_attractors.values.tolist() == [2, 2]
    ds = pk.sweep(
        DRIVEN, forcing_amplitude=amplitudes, of="basin_fractions", store=store, chunks=chunks,
        **BOX,
    )  # fmt: skip
    assert ds.basin_fraction.sizes == {"forcing_amplitude": 3, "attractor": SLOTS}
    assert ds.n_attractors.values.tolist() == [2, 2, 1]
    assert ds.remaining_fraction.values.tolist() == [0.0, 0.0, 0.0]
    middle = (2.0 * np.arange(SIDE) + 1.0) / SIDE - 1.0
    for i, amplitude in enumerate(amplitudes):
        system = DRIVEN.replace(forcing_amplitude=amplitude)
        one = pk.basins(system, phi=np.pi * middle, dphi=2.0 * middle)
        number = one.sizes["attractor"]
        assert number == ds.n_attractors.values[i]
        for name, whole in (("basin_fraction", ds.basin_fraction[i]),
                            ("basin_fraction_error", ds.basin_fraction_error[i])):  # fmt: skip
            assert whole.values[:number] == pytest.approx(one[name].values, abs=1e-12)
            assert np.isnan(whole.values[number:]).all()
        least = one.attractor_phi.min("crossing").values
        assert ds.attractor_angle.values[i, :number] == pytest.approx(least, abs=1e-8)


def test_cells_without_attractors():
    ds = pk.sweep(DRIVEN, damping=[0.0, 0.4], of=["basin_fraction", "n_attractors"], **BOX)
    assert ds.n_attractors.values.tolist() == [-1, 2]
    assert np.isnan(ds.basin_fraction.values[0]).all()
    assert np.nansum(ds.basin_fraction.values[1]) == pytest.approx(1.0)


def test_motions_that_do_not_settle_are_told(monkeypatch):
    def without_patience(*arguments):
        search = find(*arguments)
        search.open[TOO_WEAK] = 3
        return search

    monkeypatch.setattr("phasekit.motion.shares.find", without_patience)
    with pytest.warns(RuntimeWarning, match="n_attractors: 3 of the motions .* damped so weakly"):
        pk.sweep(DRIVEN, damping=[0.4], of="n_attractors", **BOX)


@pytest.mark.slow
def test_more_attractors_than_there_is_place_for_are_counted():
    row = pk.Perturbed(pk.Potential("1 - cos(x)", "x"), damping=0.5)
    ds = pk.sweep(row, damping=[0.5], of="basin_fractions", box_phi=5.0 * np.pi, box_dphi=0.5)
    assert ds.n_attractors.values.tolist() == [5]
    wide = pk.sweep(row, damping=[0.5], of="basin_fractions", box_phi=11.0 * np.pi, box_dphi=0.5)
    assert wide.n_attractors.values.tolist() == [11]
    angles = wide.attractor_angle.values[0]
    assert angles == pytest.approx(2.0 * np.pi * np.arange(-5, 3), abs=1e-8)
    kept = wide.basin_fraction.values[0]
    assert kept == pytest.approx(np.full(SLOTS, 1.0 / 11.0), abs=0.03)
    assert wide.remaining_fraction.item() == pytest.approx(1.0 - kept.sum())
    assert wide.remaining_fraction.item() > 0.2


def test_the_numbers_of_attractors_do_not_depend_on_where_the_search_begins():
    # Two of period one, and for a stronger drive orbits of a longer period.
    duffing = pk.Perturbed(pk.Potential("x^4/4 - x^2/2", "x"), damping=0.3,
                           forcing=pk.Harmonic(0.2, 1.0))  # fmt: skip
    law = duffing.law
    values = law.values(*duffing.parameters.values())
    states = np.random.default_rng(5).uniform(-2.0, 2.0, (60, 2))
    one = find(law, values, 2.0 * np.pi, states).result()
    other = find(law, values, 2.0 * np.pi, states[::-1]).result()
    assert len(one.state) > 2
    assert one.period.tolist() == other.period.tolist()
    np.testing.assert_allclose(one.state[..., 0], other.state[..., 0], atol=1e-8)
    np.testing.assert_allclose(one.multiplier, other.multiplier, rtol=1e-6)


def test_motions_that_take_too_many_steps_are_undecided_and_not_away(monkeypatch):
    from phasekit.motion import basins

    law = pk.Perturbed(pk.Coefficients(1.0, 0.35, 0.12), damping=0.2)
    search = find(law.law, law.law.values(*law.parameters.values()), 1.0, np.array([[1.0, 0.0]]))
    original = basins.strobe

    def worn(*arguments, **keywords):
        found = original(*arguments, **keywords)
        status = np.array([EXHAUSTED, FAILED])
        return found._replace(code=np.array([-1, -1]), status=status)

    monkeypatch.setattr(basins, "strobe", worn)
    found = basins.basins(search, {0: np.array([0.5]), 1: np.array([0.0, 0.1])})
    assert found.basin.tolist() == [[basins.UNDECIDED, basins.ESCAPED]]


@pytest.mark.slow
def test_stored_shares_are_the_same_however_they_were_made(tmp_path, monkeypatch):
    """Interrupted and resumed, extended, by processes and by dask: the same bits."""
    pytest.importorskip("zarr")
    amplitudes, of = [0.0, 0.2, 0.6, 0.3], ["basin_fractions", "lyapunov"]
    start = {"phi": 0.1, "dphi": 0.2, "t": 20.0}
    whole = pk.sweep(DRIVEN, forcing_amplitude=amplitudes, of=of, **BOX, **start)
    assert np.nansum(whole.basin_fraction, axis=1) == pytest.approx(np.ones(4))
    how = {"of": of, "chunks": {"forcing_amplitude": 1}, **BOX, **start}

    def same(ds):
        assert set(ds.data_vars) == set(whole.data_vars)
        for name, values in whole.data_vars.items():
            assert ds[name].values.tobytes() == values.values.tobytes(), name

    def interrupted(tally, tile):
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(progress._NoBar, "update", interrupted)
        with pytest.raises(KeyboardInterrupt, match=r"^1 of 2 tiles"):
            pk.sweep(
                DRIVEN, forcing_amplitude=amplitudes[:2], store=tmp_path / "map.zarr",
                workers=1, progress=False, **how,
            )  # fmt: skip
    for count, workers in ((2, 1), (4, 2)):
        pk.sweep(
            DRIVEN, forcing_amplitude=amplitudes[:count], store=tmp_path / "map.zarr",
            workers=workers, **how,
        )  # fmt: skip
    opened = pk.open_map(tmp_path / "map.zarr")
    same(opened)
    assert opened.isel(forcing_amplitude=2).phasekit.system() == DRIVEN.replace(
        forcing_amplitude=0.6
    )
    assert opened.phasekit.system() == DRIVEN.replace(forcing_amplitude=amplitudes)
    pytest.importorskip("dask")
    same(pk.open_map(tmp_path / "map.zarr", chunks={}).compute())
