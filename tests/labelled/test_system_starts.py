"""Branches of systems of two states: where they start, and that none is missed."""

from __future__ import annotations

import numpy as np
import pytest

import phasekit as pk

DISK = pk.GyroRotorDisk(beta=1.0, e=0.1, a=0.01, r=0.1, omega1=15.0, m=2.0)
ROTOR = pk.FreeGyroRotor(DISK, 0.02, momentum=0.6)
BRAKED = pk.Perturbed(pk.Coefficients(4.0, 1.0, 0.5), damping=0.1, torque=0.1)
WELL = pk.Perturbed(pk.Potential("x^4/4 - x^2/2", "x"), damping=0.1, torque=0.1)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("system", "parameter", "span"),
    [(ROTOR, "momentum", (0.1, 1.0)), (BRAKED, "torque", (0.0, 0.5)), (WELL, "torque", (0.0, 0.2)),
     (BRAKED, "damping", (0.05, 0.2))],
    ids=["rotor", "torque", "well", "damping"],
)  # fmt: skip
def test_every_equilibrium_lies_on_a_branch(system, parameter, span):
    branches = pk.diagram(system, parameter, span=span)
    x = "x" if system is WELL else "phi"
    for value in np.linspace(*span, 5):
        ds = pk.equilibria(system.replace(**{parameter: float(value)}))
        places = ds.phi.values[np.isfinite(ds.phi.values)]
        assert places.size >= 2
        for place in places:
            gaps = []
            for branch in branches:
                at, on = branch.points[parameter].values, branch.points[x].values
                on = np.unwrap(on) if x == "phi" else on
                cross = np.flatnonzero((at[:-1] - value) * (at[1:] - value) <= 0.0)
                share = (value - at[cross]) / (at[cross + 1] - at[cross])
                found = on[cross] + share * (on[cross + 1] - on[cross])
                gap = found - place
                gaps += [*np.abs(np.angle(np.exp(1j * gap)) if x == "phi" else gap)]
            assert min(gaps) < 5e-3, (value, place)


@pytest.mark.slow
@pytest.mark.parametrize(("system", "parameter"), [(ROTOR, "momentum"), (BRAKED, "torque"),
                                                   (WELL, "torque")])  # fmt: skip
def test_a_label_is_a_start(system, parameter):
    own = system.parameters[parameter]
    ds = pk.equilibria(system)
    span = (0.9 * own, 1.1 * own)
    labels = [str(label) for label in ds.equilibrium.values]
    assert len(labels) >= 3
    for i, label in enumerate(labels):
        branch = pk.continuation(system, parameter, x0=label, span=span)
        at = int(np.argmin(np.abs(branch.points[parameter].values - own)))
        assert branch.points[parameter].values[at] == own
        point = branch.points.isel(point=at)
        assert point[branch.problem.state[0]].item() == pytest.approx(ds.phi.values[i], abs=1e-11)
        assert point[branch.problem.state[1]].item() == 0.0
    first = pk.continuation(system, parameter, span=span)
    assert first == pk.continuation(system, parameter, x0=labels[0], span=span)
    with pytest.raises(pk.ParameterError, match="x0: equilibrium 'middle' is unknown"):
        pk.continuation(system, parameter, x0="middle", span=span)
