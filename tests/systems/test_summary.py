"""What systems say of themselves to people."""

import re
import subprocess
import sys

import numpy as np
import pytest

import phasekit as pk

DISK = pk.GyroRotorDisk(beta=40 * pk.deg, e=0.05, a=0.024, r=0.2, omega1=300 * pk.rpm)


def test_a_disk_in_degrees_millimetres_and_revolutions():
    head, regime, folds = str(DISK).splitlines()
    assert head == (
        "GyroRotorDisk: beta = 40°, e = 50 mm, a = 24 mm, r = 200 mm, omega1 = 300 rpm, "
        "g = 9.80665 m s⁻²"
    )
    eq = pk.equilibria(DISK)
    angles = [f"{float(x):.6g}" for x in np.degrees(eq.phi.values[[0, 2, 1, 3]])]
    assert regime == (
        "figure-eight; centers at {}° and {}°, saddles at {}° and {}°".format(*angles)
    )
    assert f"fold margin {eq.fold_margin.item():.3g}" in folds
    for name, unit in (("beta", "deg"), ("a", "mm"), ("omega1", "rpm"), ("e", "mm")):
        found = pk.critical(DISK, name).phasekit.to(critical_fold=unit).critical_fold.values
        now = DISK.parameters[name]
        now = {"deg": np.degrees(now), "mm": 1e3 * now, "rpm": now / pk.rpm}[unit]
        nearest = found[np.nanargmin(abs(found - now))]
        said = float(re.search(rf"\b{name} = ([-\d.]+)", folds)[1])
        assert said == pytest.approx(nearest, rel=1e-5)


@pytest.mark.parametrize(
    "mirrored", [{"beta": 140 * pk.deg}, {"a": -0.024}, {"omega1": -300 * pk.rpm}]
)
def test_folds_that_are_said_are_folds(mirrored):
    system = DISK.replace(**mirrored)
    said = dict(re.findall(r"(\w+) = ([-\d.]+)", str(system).splitlines()[2]))
    assert set(said) == {"beta", "e", "a", "omega1"}
    units = {"beta": pk.deg, "e": 1e-3, "a": 1e-3, "omega1": pk.rpm}
    for name, value in said.items():
        at = [float(value) * units[name] * (1 + way) for way in (-1e-4, 1e-4)]
        counts = [int(pk.equilibria(system.replace(**{name: x})).n_equilibria) for x in at]
        assert sorted(counts) == [2, 4], name


@pytest.mark.parametrize(
    ("system", "words"),
    [
        (pk.Pendulum(length=1.5), "Pendulum: length = 1.5 m, .*center at 0°, saddle at 180°"),
        (pk.Coefficients(0.0, 0.0, 0.0), "no force: every angle is an equilibrium"),
        (pk.Coefficients(4.0, 4.0, 0.0), "2 equilibria"),
        (pk.Coefficients(1.0, 0.0, 0.0), "heteroclinic: two saddles of one energy"),
        (pk.Coefficients(1e308, 1e308, 1e308), "A = 1e[+]308"),
        (DISK.replace(beta=[0.1, 0.2]), r"beta = \[5.72958, 11.4592\]°.*a system for each cell al"),
        (DISK.replace(beta=np.linspace(0, 1, 50)), "beta = <50 values, 0 to 57.2958>°"),
        (pk.Potential("x^2", "x"), r"^Potential\('x\*\*2', 'x'\)$"),
    ],
)
def test_other_systems(system, words):
    assert re.search(words, str(system), re.DOTALL)
    assert "nan" not in str(system)


def test_notebooks_and_ipython_show_the_same(monkeypatch):
    for system in (DISK, pk.Potential("x^2", "x"), DISK.replace(a=[0.1, 0.2])):
        text = re.sub("<[^>]*>", " ", system._repr_html_())
        for word in re.findall(r"\w+", re.sub(r"<.*?>", "", str(system))):
            assert word in text
    parts = []
    printer = type("Printer", (), {"text": lambda self, text: parts.append(text)})()
    DISK._repr_pretty_(printer, False)
    assert parts == [str(DISK)]


def test_quantities_are_a_table_in_notebooks():
    page = pk.quantities()._repr_html_()
    assert page.count("<tr>") == len(pk.quantities()) + 1
    assert "<td style='text-align: left'>figure_eight</td>" in page


@pytest.mark.slow
def test_saying_it_compiles_nothing():
    code = (
        "import sys\n"
        "import phasekit as pk\n"
        f"print(pk.{DISK!r})\n"
        "assert 'llvmlite' not in sys.modules\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout == f"{DISK}\n"
