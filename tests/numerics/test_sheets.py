"""Cells in which numbers of equilibria may change, against curves in closed form."""

import numpy as np
import pytest
import sympy as sp

from phasekit.numerics.intervals.sheets import Sheets

x, a, b = sp.symbols("x a b", real=True)
LOW, HIGH = np.array([-1.0, -1.0]), np.array([1.0, 2.0])


def of_cells(side, places):
    return tuple(((places - LOW) / (HIGH - LOW) * side).astype(int).T)


@pytest.mark.slow
def test_every_fold_lies_in_a_cell_that_is_kept_and_few_others_are():
    window = np.array([-3.0]), np.array([3.0])
    sheets = Sheets([a + b * x - x**3], [x], [a, b], {}, window, np.array([True]))
    found = sheets.changes(LOW, HIGH, 6)
    s = np.linspace(-0.79, 0.79, 20_001)  # x of the fold
    places = np.stack([-2 * s**3, 3 * s**2], axis=1)
    assert found.merging[of_cells(64, places)].all()
    middles = (np.stack(np.meshgrid(*[np.arange(64)] * 2, indexing="ij"), -1) + 0.5) / 64
    middles = LOW + middles * (HIGH - LOW)
    gap = np.min(np.linalg.norm((middles[:, :, None] - places[::40]) / (HIGH - LOW), axis=-1), -1)
    assert np.all(gap[found.merging] < 4 / 64)
    assert not found.leaving.any()


def test_what_leaves_the_window_is_kept():
    window = np.array([-3.0]), np.array([0.5])
    sheets = Sheets([a + b * x - x**3], [x], [a, b], {}, window, np.array([True]))
    found = sheets.changes(LOW, HIGH, 5)
    rise = np.linspace(-0.99, 1.99, 5_001)
    places = np.stack([0.125 - 0.5 * rise, rise], axis=1)
    places = places[np.abs(places[:, 0]) < 1]
    assert found.leaving[of_cells(32, places)].all()
    assert found.leaving.sum() < 150


def test_stability_is_lost_where_the_trace_vanishes_but_not_at_saddles():
    v, c, d = sp.symbols("v c d", real=True)
    window = np.array([-2.0, -2.0]), np.array([2.0, 2.0])
    sheets = Sheets([v, c * x + d * v], [x, v], [c, d], {}, window, np.array([True, True]))
    found = sheets.changes(np.array([-1.0, -1.0]), np.array([1.0, 1.0]), 4)
    assert found.losing[:8, 7:9].all()  # a center: d = 0, c < 0
    assert not found.losing[9:].any()  # a saddle: c > 0
    assert not found.losing[:7, :6].any()
