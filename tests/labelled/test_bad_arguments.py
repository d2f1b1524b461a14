"""Every public function refuses each argument that is wrong, and names it."""

import numpy as np
import pytest
import xarray as xr

import phasekit as pk

C = pk.Coefficients(4.3, 1.2, 0.7)
DISK = pk.GyroRotorDisk(beta=0.3, e=0.0115, a=0.02, r=0.21, omega1=2.5)

CALLS = {
    pk.potential: {"phi": 0.3},
    pk.gradient: {"phi": 0.3},
    pk.curvature: {"phi": 0.3},
    pk.energy: {"phi": 0.3, "dphi": 0.2},
    pk.phase_velocity: {"phi": 0.3, "energy": 9.0},
    pk.equilibria: {},
    pk.separatrices: {},
    pk.critical: {"parameter": "lam"},
    pk.sweep: {"axes": {"A": [1.0]}},
}
WRONG_STATES = [True, "three", None, 1j, np.nan, np.inf, [], [[0.1, 0.2]], np.ones((2, 2)), [None]]
WRONG_STATES += [{}, object, xr.DataArray([True]), xr.DataArray(np.nan), ["a"], [0.1, True]]
WRONG_SYSTEMS = [None, 3.0, "disk", pk.GyroRotorDisk, [1, 2], {}, np.ones(3), pk.equilibria(C)]


@pytest.mark.parametrize("function", CALLS, ids=lambda f: f.__name__)
@pytest.mark.parametrize("wrong", WRONG_SYSTEMS, ids=lambda x: type(x).__name__)
def test_wrong_systems(function, wrong):
    with pytest.raises(pk.ParameterError, match=r"^system: got .*, wants one of Coefficients"):
        function(wrong, **CALLS[function])


STATES = [(f, name) for f in list(CALLS)[:5] for name in CALLS[f]]


@pytest.mark.parametrize(("function", "name"), STATES)
@pytest.mark.parametrize("wrong", WRONG_STATES, ids=repr)
def test_wrong_states(function, name, wrong):
    with pytest.raises(pk.ParameterError, match=rf"^{name}: got .*, wants "):
        function(C, **{**CALLS[function], name: wrong})


def test_hints_lead_from_what_it_is_to_a_system():
    with pytest.raises(pk.ParameterError, match=r"pk\.Coefficients\(A, B, C\)"):
        pk.equilibria((4.0, 1.0, 0.5))
    with pytest.raises(pk.ParameterError, match="it is a class"):
        pk.equilibria(pk.Reduced)
    with pytest.raises(pk.ParameterError, match=r"ds\.phasekit\.system\(\)"):
        pk.equilibria(pk.equilibria(C))


@pytest.mark.parametrize("parameter", ["bta", "m", "A", "", None, 3, ["beta"], "phi"])
def test_wrong_parameters_of_critical(parameter):
    with pytest.raises(pk.ParameterError, match=r"parameter of critical for GyroRotorDisk .*unkn"):
        pk.critical(DISK, parameter)


def test_critical_takes_lam_and_psi_and_the_systems_own():
    with pytest.raises(pk.ParameterError, match="'beta' is unknown; valid are: lam, psi, A, B, C"):
        pk.critical(C, "beta")


def test_a_wrong_argument_is_a_value_error():
    assert issubclass(pk.ParameterError, ValueError)
    assert issubclass(pk.ParameterError, pk.PhasekitError)
    assert issubclass(pk.StoreError, OSError)
