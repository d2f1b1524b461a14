"""Columns of numbered equilibria: found once, and what is said of what could not be computed."""

import warnings
from typing import NamedTuple

import numpy as np
import pytest
import xarray as xr

import phasekit as pk
from phasekit.cells import evaluate
from phasekit.cells.numbered import _with_warning
from phasekit.phase.numerical import differences, functions

NAN = np.nan


class Found(NamedTuple):
    period: np.ndarray
    action: np.ndarray
    period_error: np.ndarray
    action_error: np.ndarray


class Pass:
    groups = ("orbits",)

    def resolved(self, *arrays):
        return Found(*map(np.array, arrays))


def test_actions_that_are_not_known_are_told():
    with warnings.catch_warnings(record=True, action="always") as caught:
        _with_warning(
            Pass(), "V", [1.0, NAN, NAN], [NAN, NAN, NAN], [0.0, 0.1, NAN], [0.2, 0.3, NAN]
        )
    said = [str(warning.message) for warning in caught]
    assert len(said) == 2
    assert (
        said[0] == "period of V: 1 of 3 values are NaN, because their error may be as large as 0.1"
    )
    assert said[1].endswith("their error may be as large as 0.2")


# ------------------------------------------------------------------------------ columns

WELL = pk.Potential("x^4/4 - mu*x^2/2 - h*x", "x", {"mu": 1.0, "h": 0.0})
SLOPE = pk.Potential("x^3/3 + mu*x", "x", {"mu": 1.0})
MU, H = np.linspace(-1.0, 1.0, 12), np.linspace(-0.5, 0.5, 7)
BOTH = ("equilibria", "separatrices")


@pytest.fixture
def small_tiles(monkeypatch):
    """Maps in memory are computed in tiles of three cells."""
    tiles = evaluate.tiles
    monkeypatch.setattr(evaluate, "tiles", lambda sizes, *_, **__: tiles(sizes, cells=3))


@pytest.mark.parametrize("of", ["equilibria", "separatrices", BOTH, ["phi", "topology"]])
def test_each_cell_is_solved_once(monkeypatch, of):
    solved, search = [], functions.find_equilibria

    def counting(systems, **keywords):
        solved.append(systems.size)
        return search(systems, **keywords)

    monkeypatch.setattr(functions, "find_equilibria", counting)
    monkeypatch.setattr(differences, "equilibria", counting)
    # More cells than a survey of a few is kept for, and of parameters that no other test has.
    assert pk.sweep(WELL, mu=np.linspace(-1.0, 1.0, 301), h=[0.125], of=of).sizes["mu"] == 301
    assert sum(solved) == 301


def test_tiles_with_fewer_equilibria_are_filled_up(small_tiles):
    mu = np.linspace(2.0, -1.5, 7)
    ds = pk.sweep(SLOPE, mu=mu)
    assert [ds.sizes[dim] for dim in ("equilibrium", "saddle")] == [2, 1]
    want = np.sqrt(np.where(mu < 0.0, -mu, np.nan))
    np.testing.assert_allclose(ds.phi, np.stack([-want, want], axis=1), rtol=1e-15)
    np.testing.assert_array_equal(ds.n_equilibria, 2 * (mu < 0.0))
    np.testing.assert_array_equal((ds.kind != 0).sum("equilibrium"), ds.n_equilibria)
    np.testing.assert_array_equal(ds.loop[:, 0] != 0, mu < 0.0)
    none = pk.sweep(SLOPE, mu=[0.5, 1.0, 1.5, 2.0])
    assert none.sizes["equilibrium"] == none.sizes["saddle"] == 0


def test_tiles_do_not_show(small_tiles, monkeypatch):
    cut = pk.sweep(WELL, mu=MU, h=H)
    monkeypatch.undo()
    assert cut.identical(pk.sweep(WELL, mu=MU, h=H))


def test_columns_that_have_no_room_are_refused(monkeypatch):
    monkeypatch.setattr("phasekit.numerics.memory.ALWAYS", 0)
    monkeypatch.setattr("phasekit.numerics.memory.available_memory", lambda: 5000)
    assert pk.sweep(WELL, mu=MU, h=H, of="n_equilibria", dtype="float32").sizes["h"] == 7
    with pytest.raises(pk.ParameterError, match="largest: phi"):
        pk.sweep(WELL, mu=MU, h=H, of="phi")


AT = {"phi": [0.1, 0.2], "dphi": 0.1}


@pytest.mark.slow
@pytest.mark.parametrize("what", [{}, {"of": ["n_equilibria"]}, {"of": ["phi", "period"], **AT}])
def test_lazy_parameters(what):
    eager = pk.sweep(WELL, mu=MU, h=H, **what)
    mu = xr.DataArray(MU, dims="mu").chunk(mu=5)
    for h in (H, xr.DataArray(H, dims="h").chunk(h=3)):
        lazy = pk.sweep(WELL, mu=mu, h=h, **what)
        assert all(one.chunks for one in lazy.data_vars.values())
        assert lazy.compute().identical(eager)


@pytest.mark.slow
def test_a_lazy_parameter_of_two_dims():
    mu = xr.DataArray(np.outer(MU, H), dims=("u", "v"))
    lazy = pk.separatrices(WELL.replace(mu=mu.chunk(u=5)))
    assert lazy.compute().identical(pk.separatrices(WELL.replace(mu=mu)))
    disk = pk.GyroRotorDisk(beta=0.7, e=0.05, a=0.024, r=0.2, omega1=6.0, m=1)
    rotor = pk.FreeGyroRotor(disk, 0.5)
    speed = xr.DataArray(np.linspace(1.0, 30.0, 5), dims="omega1")
    lazy = pk.equilibria(rotor.replace(omega1=speed.chunk(omega1=2)))
    assert lazy.compute().identical(pk.equilibria(rotor.replace(omega1=speed)))


@pytest.mark.slow
def test_what_is_not_proved_is_said_of_all_cells(small_tiles):
    well = pk.Potential("-a*exp(-((x - 3.3)/0.05)^2)", "x", {"a": 1.0}, interval=(-10.0, 10.0))
    a = np.linspace(0.5, 2.0, 5)
    lazy = xr.DataArray(a, dims="a").chunk(a=2)
    for one in (a, lazy):
        for what in ("equilibria", "separatrices"):
            with pytest.warns(RuntimeWarning, match="of 10 such stretches, in 5 of 5 systems"):
                pk.sweep(well, a=one, of=what)


def levels(energy, saddle_energy):
    """Depth of the first well."""
    return np.fmax.reduce(saddle_energy, axis=-1) - energy[..., 0]


def test_functions_of_columns_see_one_at_least(small_tiles):
    from phasekit.cells.request import passes_of
    from phasekit.table.row import Pass

    ds = pk.sweep(SLOPE, mu=np.linspace(2.0, -1.5, 7), of=BOTH)
    one = Pass(levels, ("energy", "saddle_energy"), ("potential",), type(SLOPE).rung)
    rows = [pk.quantities()["potential"]]
    system = SLOPE.replace(mu=np.linspace(2.0, -1.5, 7))
    behind = passes_of(system, [pk.quantities()[name] for name in ("energy", "saddle_energy")])
    found = evaluate.evaluate(system, rows, (one, *behind))
    np.testing.assert_array_equal(found.potential, ds.saddle_energy[:, 0] - ds.energy[:, 0])


def test_no_piece_of_work_is_large_of_what_is_integrated(monkeypatch):
    # Rows of integrals take a good part of a millisecond a cell, and memory for all their nodes:
    # what a bar counts, and what is held at once, are small parts of a map.
    sizes = []
    monkeypatch.setattr(
        evaluate, "run_tasks", lambda tasks, _: sizes.extend(cells for _, cells in tasks)
    )
    well = pk.Potential("x^2/2 - h*x + k*x^4", "x", {"h": 0.0, "k": 0.0})
    pk.sweep(well, h=np.linspace(0.0, 1.0, 300), k=np.linspace(0.0, 1.0, 301), of="equilibria")
    assert sum(sizes) == 300 * 301
    assert max(sizes) <= 1 << 12
