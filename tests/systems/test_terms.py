"""Terms of one's own: what a system with them answers, against equations written by hand."""

import copy
import math
import pickle

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import phasekit as pk
from phasekit.laws.ladder import Trait
from phasekit.maps import files
from phasekit.systems.term import TERMS

PENDULUM = pk.Pendulum(length=1.0, g=1.0)
FRICTION = pk.Term("-mu*tanh(dphi/width)", {"mu": 0.1, "width": 0.3})
SLOWED = pk.Perturbed(PENDULUM, damping=0.05, terms=FRICTION)


class Motor(pk.Term):
    """Motor whose torque falls with the speed."""

    pull = pk.parameter("s-2", "torque at rest over inertia")
    idle = pk.parameter("s-1", "speed without load", positive=True, default=3.0)

    force = "pull*(1 - dphi/idle)"


def curve(t, phi, dphi, pull, idle):
    return pull * (1.0 - dphi / idle)


def by_scipy(force, state, t, **more):
    def rates(t, y):
        return [y[1], -np.sin(y[0]) + force(t, *y[:2])]

    return solve_ivp(rates, (0.0, t), state, rtol=1e-12, atol=1e-13, method="DOP853").y[:, -1]


def test_a_formula_moves_as_scipy_has_it():
    want = by_scipy(lambda t, x, v: -0.05 * v - 0.1 * np.tanh(v / 0.3), [1.0, 0.2], 7.0)
    ds = pk.flow(SLOWED, 1.0, 0.2, 7.0)
    assert [ds.motion_phi.item(), ds.motion_dphi.item()] == pytest.approx(want, abs=1e-9)
    swept = pk.flow(SLOWED.replace(mu=[0.1, 0.4]), 1.0, 0.2, [7.0, 9.0])
    assert swept.motion_phi.dims == ("mu", "time")
    assert swept.motion_phi[0, 0].item() == pytest.approx(want[0], abs=1e-9)


@pytest.mark.slow
def test_formula_function_and_class_are_one_law():
    values = {"pull": 0.2, "idle": 3.0}
    formula = pk.Term("pull*(1 - dphi/idle)", values)
    systems = [pk.Perturbed(PENDULUM, terms=one) for one in (
        Motor(pull=0.2), formula, pk.Term(curve, values), pk.Term("pull - pull*dphi/idle", values)
    )]  # fmt: skip
    first, *rest = (pk.flow(one, 0.3, 0.1, [1.0, 6.0]).motion_dphi for one in systems)
    for other in rest:
        np.testing.assert_allclose(other, first, atol=2e-9)
    damped = pk.Perturbed(PENDULUM, damping=0.2 / 3.0, torque=0.2)
    np.testing.assert_allclose(pk.flow(damped, 0.3, 0.1, [1.0, 6.0]).motion_dphi, first, atol=1e-9)
    rests = [pk.equilibria(one).x for one in systems[:2]]
    for x in rests:
        angles = np.sort(x.sel(state="phi").values)
        assert angles == pytest.approx([np.arcsin(0.2), np.pi - np.arcsin(0.2)], abs=1e-12)


@pytest.mark.slow
def test_equilibria_of_a_function_are_searched_and_said_not_to_be_proved():
    system = pk.Perturbed(PENDULUM, terms=pk.Term(curve, {"pull": 0.2, "idle": 3.0}))
    with pytest.warns(UserWarning, match="nothing else"):
        ds = pk.equilibria(system)
    assert not ds.complete
    assert ds.x.sel(state="phi").values.min() == pytest.approx(np.arcsin(0.2), abs=1e-9)


def test_equilibria_feel_a_term_and_their_kinds_follow():
    """A spring of one's own, and self-excitation: x'' = -x + k x + (d - x^2) x'."""
    well = pk.Potential("x^2/2", "x", interval=(-2.0, 2.0))
    own = pk.Term("k*x + (d - x^2)*dx", {"k": 0.5, "d": [-0.3, 0.3]})
    ds = pk.equilibria(pk.Perturbed(well, terms=own))
    assert ds.n_equilibria.values.tolist() == [1, 1]
    assert ds.complete.all()
    assert ds.kind.values.ravel().tolist() == [6, 7]  # a stable focus, an unstable one
    root = 0.5 * np.array([-0.3 + 1j * np.sqrt(4 * 0.5 - 0.09)])
    assert ds.eigenvalue[0, 0, 0].item() == pytest.approx(root.item())


def test_branches_and_cycles_of_a_term():
    """Rayleigh's oscillator as a term: a Hopf point at d = 0, amplitude 2 sqrt(d/3)."""
    well = pk.Potential("x^2/2", "x", interval=(-2.0, 2.0))
    system = pk.Perturbed(well, terms=pk.Term("d*dx - dx^3", {"d": -0.1}))
    branch = pk.continuation(system, "d", x0=[0.0, 0.0], span=(-0.2, 0.3))
    (hopf,) = branch.special("hopf")
    assert hopf.parameters["d"] == pytest.approx(0.0, abs=1e-9)
    cycle = pk.periodic_orbit(system.replace(d=0.01), [0.1, 0.0], settle=800.0)
    assert cycle.x.max().item() == pytest.approx(2.0 * np.sqrt(0.01 / 3.0), rel=1e-3)


@pytest.mark.slow
def test_a_harmonic_as_a_term_is_the_forcing():
    forced = pk.Perturbed(PENDULUM, damping=0.2, forcing=pk.Harmonic(0.3, 1.1, 0.4))
    own = pk.Term("F*cos(nu*t + alpha)", {"F": 0.3, "nu": 1.1, "alpha": 0.4})
    same = pk.Perturbed(PENDULUM, damping=0.2, terms=own)
    assert same.traits == Trait.DAMPED | Trait.DRIVEN | Trait.OWN
    for call in (
        lambda s: pk.flow(s, 0.3, 0.1, [2.0, 9.0]).motion_phi,
        lambda s: pk.stroboscopic(s, 0.3, 0.1, n=3, skip=1).section_dphi,
        lambda s: pk.lyapunov(s, 0.3, 0.1, duration=30.0).lyapunov_exponent,
        lambda s: pk.poincare_section(s, 0.3, 0.1, section=0.1, duration=20.0).section_time,
    ):
        np.testing.assert_allclose(call(same), call(forced), rtol=1e-7, atol=1e-9)
    assert pk.stroboscopic(same, 0.3, 0.1, n=2).section_time[1].item() == pytest.approx(
        2.0 * np.pi / 1.1
    )
    orbits = [pk.periodic_orbit(s, [0.0, 0.0], settle=100.0) for s in (forced, same)]
    np.testing.assert_allclose(
        np.abs(orbits[1].multiplier), np.abs(orbits[0].multiplier), atol=1e-8
    )


@pytest.mark.slow
def test_a_frame_that_is_modulated_is_a_problem_as_well():
    """The torque of omega1' in formulas, as in motions."""
    disk = pk.GyroRotorDisk(beta=1.0, e=0.05, a=0.02, r=0.1, omega1=12.0)
    shaken = pk.Perturbed(disk, damping=1.0, modulation={"omega1": pk.Harmonic(0.5, 7.0)})
    cycle = pk.periodic_orbit(shaken, [0.0, 0.0], settle=40.0)
    start = {name: cycle[name][0].item() for name in ("phi", "dphi")}
    period = 2.0 * np.pi / 7.0
    end = pk.flow(shaken, start["phi"], start["dphi"], period)
    assert end.motion_phi.item() == pytest.approx(start["phi"], abs=1e-8)
    assert end.motion_dphi.item() == pytest.approx(start["dphi"], abs=1e-7)


def test_a_state_of_its_own():
    """X'' = -w^2 x + k y, y' = -b (y - x'): against SciPy, named and started by the term."""
    base = pk.Potential("w^2*x^2/2", "x", {"w": 1.3})
    own = pk.Term("k*y", {"k": 0.2, "b": 0.7}, states={"y": "-b*(y - dx)"}, start={"y": 0.5})
    system = pk.Perturbed(base, damping=0.1, terms=own)
    assert Trait.STATEFUL in system.traits
    want = solve_ivp(
        lambda t, u: [u[1], -1.69 * u[0] - 0.1 * u[1] + 0.2 * u[2], -0.7 * (u[2] - u[1])],
        (0.0, 6.0), [0.3, 0.0, 0.5], rtol=1e-12, atol=1e-13,
    ).y[:, -1]  # fmt: skip
    ds = pk.flow(system, 0.3, 0.0, 6.0)
    found = [ds[f"motion_{name}"].item() for name in ("phi", "dphi", "y")]
    assert found == pytest.approx(want, abs=1e-8)
    assert ds.motion_x.item() == ds.motion_phi.item()
    other = pk.flow(system, x=0.3, dx=0.0, t=6.0, y=0.0)
    assert other.motion_y.item() != ds.motion_y.item()
    exponents = pk.lyapunov(system, 0.3, 0.0, duration=200.0)
    assert exponents.sizes["exponent"] == 3
    assert exponents.lyapunov_sum.item() == pytest.approx(-0.8, abs=1e-8)


def belt(t, phi, dphi, mu):
    """Dry friction on a belt, and what is smooth beside it."""
    return -mu * math.copysign(1.0, dphi - 0.73) - 0.4 * dphi**3 + math.sin(phi)


@pytest.mark.parametrize("value", [[1.0, 2.0], np.zeros(3), "a", None, 1j])
def test_a_force_that_returns_no_number_is_refused_by_name(value):
    term = pk.Term(lambda t, phi, dphi: value)
    with pytest.raises(
        pk.ParameterError, match="force: got the function <lambda>, wants one .*one"
    ):
        assert pk.Perturbed(PENDULUM, terms=term).law


def test_a_function_is_looked_at_once_at_values_of_its_parameters():
    calls = []

    def force(t, phi, dphi, k):
        calls.append(t)
        return -k * dphi

    slowed = pk.Perturbed(PENDULUM, terms=pk.Term(force, {"k": 0.1}))
    assert slowed.law.own
    first = len(calls)
    assert slowed.replace(length=2.0).law.own
    assert 0 < first == len(calls)


@pytest.mark.parametrize(
    "force", ["-mu*sign(dphi)", "mu*Heaviside(phi - 1)", lambda t, phi, v, mu: mu * (phi < 1), belt]
)
def test_a_jump_is_refused_by_name(force):
    system = pk.Perturbed(PENDULUM, terms=pk.Term(force, {"mu": 0.1}))
    for call in (
        lambda: pk.flow(system, 1.0, 0.0, 1.0),
        lambda: pk.equilibria(system),
        lambda: pk.continuation(system, "mu", x0=[0.0, 0.0], span=(0.0, 1.0)),
    ):
        with pytest.raises(pk.ParameterError, match=r"without jumps.*tanh\(dphi/width\)"):
            call()


@pytest.mark.parametrize(
    "force",
    [
        lambda t, phi, v: -math.tanh((v - 0.7) / 1e-9) - 40.0 * v**3,
        lambda t, phi, v: 1.0 / (phi - 0.5) ** 2 + 1.0 / (phi + 0.123),
        lambda t, phi, v: 1e8 + math.sin(1e6 * phi) - math.sqrt(abs(v)),
        lambda t, phi, v: math.fmod(t, 1.0) + 0.3,
        lambda t, phi, v: math.sqrt(1.0 - phi),
    ],
)
def test_steep_functions_and_poles_are_no_jumps(force):
    assert Trait.JUMPING not in pk.Perturbed(PENDULUM, terms=pk.Term(force)).traits


def test_a_kink_moves_and_is_refused_by_what_has_to_be_smooth():
    system = pk.Perturbed(PENDULUM, terms=pk.Term("-mu*Abs(dphi)", {"mu": 0.3}))
    assert Trait.KINKED in system.traits
    want = by_scipy(lambda t, x, v: -0.3 * abs(v), [1.0, 0.2], 5.0)
    ds = pk.flow(system, 1.0, 0.2, 5.0)
    assert ds.motion_dphi.item() == pytest.approx(want[1], abs=1e-8)
    for call in (
        lambda: pk.equilibria(system),
        lambda: pk.continuation(system, "mu", x0=[0.0, 0.0], span=(0.0, 1.0)),
        lambda: pk.periodic_orbit(system, [0.1, 0.0]),
    ):
        with pytest.raises(pk.ParameterError, match="without jumps and kinks"):
            call()
    # The quadratic drag of the keyword, by a formula: its derivative is continuous.
    drag = pk.Perturbed(PENDULUM, terms=pk.Term("-q*Abs(dphi)*dphi", {"q": 0.3}))
    same = pk.Perturbed(PENDULUM, quadratic=0.3)
    np.testing.assert_allclose(
        pk.flow(drag, 1.0, 0.2, 5.0).motion_dphi, pk.flow(same, 1.0, 0.2, 5.0).motion_dphi,
        atol=1e-10,
    )  # fmt: skip


def test_a_term_is_a_value():
    motor = Motor(pull=0.2)
    system = pk.Perturbed(PENDULUM, damping=0.1, terms=[motor, FRICTION])
    assert list(system.parameters)[-4:] == ["pull", "idle", "mu", "width"]
    assert system.replace(idle=4.0).terms[0] == Motor(pull=0.2, idle=4.0)
    assert system.replace(terms=None).terms == ()
    for one in (motor, FRICTION, system):
        for again in (pickle.loads(pickle.dumps(one)), copy.deepcopy(one), copy.copy(one)):
            assert again == one
            assert hash(again) == hash(one)
    assert FRICTION != FRICTION.replace(mu=0.2)
    assert repr(FRICTION) == "Term('-mu*tanh(dphi/width)', {'mu': 0.1, 'width': 0.3})"
    with pytest.raises(AttributeError, match="frozen"):
        motor.pull = 1.0


def test_maps_give_the_terms_back(tmp_path):
    system = pk.Perturbed(PENDULUM, damping=0.1, terms=[Motor(pull=0.2), FRICTION])
    ds = pk.sweep(system, mu=[0.1, 0.2], pull=[0.0, 0.1], of="critical_torques")
    files.with_texts(ds).to_netcdf(tmp_path / "map.nc", engine="h5netcdf")
    cell = pk.open_map(tmp_path / "map.nc").isel(mu=1, pull=0).phasekit.system()
    assert cell == system.replace(mu=0.2, pull=0.0)
    ds.attrs["phasekit_terms"] = ds.attrs["phasekit_terms"].replace("Motor", "Engine")
    with pytest.raises(pk.ParameterError, match="the term Engine.*import the module"):
        ds.isel(mu=0, pull=0).phasekit.system()
    coded = pk.Perturbed(PENDULUM, terms=pk.Term(curve, {"pull": 0.1, "idle": 1.0}))
    ds = pk.sweep(coded, pull=[0.1, 0.2], of="critical_torques")
    with pytest.raises(pk.ParameterError, match="a term that is a function"):
        ds.isel(pull=0).phasekit.system()


def test_what_no_term_bears_is_refused_with_what_does():
    with pytest.raises(pk.ParameterError, match="without terms of your own for melnikov; flow"):
        pk.melnikov(SLOWED)
    with pytest.raises(pk.ParameterError, match="without terms of your own"):
        pk.capture(SLOWED)
    assert pk.critical_torque(SLOWED).critical_torque.values.tolist() == [-1.0, 1.0]


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: pk.Term(None), "force: got None"),
        (lambda: pk.Term("k*dphi", {"k": "much"}), "k: got 'much'"),
        (lambda: pk.Term("k*dphi", {"phi": 1.0}), "phi"),
        (lambda: pk.Term("k*dphi", {"k": 1.0}, start={"y": 0.0}), "a state of the term"),
        (lambda: pk.Term(lambda t, phi: 0.0), "arguments"),
        (lambda: pk.Perturbed(PENDULUM, terms=3.0), "terms: got 3.0, wants a pk.Term"),
        (lambda: pk.Perturbed(PENDULUM, terms=[FRICTION, FRICTION]), "differ from term to term"),
        (lambda: pk.Perturbed(PENDULUM, terms=pk.Term("k*dphi")), r"terms\[0\].*k"),
        (lambda: pk.Perturbed(PENDULUM, terms=pk.Term("g*dphi", {"g": 1.0})), "another name"),
        (lambda: pk.Perturbed(PENDULUM, terms=pk.Term("zeta(dphi)")), "zeta"),
        (lambda: pk.Perturbed(PENDULUM, terms=pk.Term("lap(dphi)")), "derivative along an axis"),
        (lambda: type("Bad", (pk.Term,), {"k": pk.parameter("1", "k")}), "wants a force"),
        (lambda: type("Bad", (pk.Term,), {"force": pk.parameter("1", "k")}), "force"),
    ],
)
def test_bad_terms(make, message):
    with pytest.raises(pk.ParameterError, match=message):
        make()
    assert "Bad" not in TERMS


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:basin")
def test_basins_with_a_term_are_those_of_the_keyword():
    well = pk.Potential("x^4/4 - x^2/2", "x")
    grid = {"phi": np.linspace(-1.5, 1.5, 7), "dphi": np.linspace(-1.0, 1.0, 5)}
    kept = pk.basins(pk.Perturbed(well, damping=0.4), **grid)
    own = pk.basins(pk.Perturbed(well, terms=pk.Term("-d*dx", {"d": 0.4})), **grid)
    rests = [ds.attractor_phi.isel(crossing=0).values for ds in (kept, own)]
    assert rests[0] == pytest.approx([-1.0, 1.0], abs=1e-9)
    assert rests[1] == pytest.approx([-1.0, 1.0], abs=1e-6)
    sure = (kept.basin >= 0).values & (own.basin >= 0).values
    assert sure.mean() > 0.9
    np.testing.assert_array_equal(own.basin.values[sure], kept.basin.values[sure])


@pytest.mark.slow
def test_sommerfeld_s_jumps_are_the_folds_of_the_power_balance():
    """An unbalanced motor on a spring, power raised and lowered slowly.

    The mean torque of the shaking is eta zeta Omega a^2/eps, a the amplitude at the speed Omega.
    """
    eps, eta, zeta, alpha, time = 0.02, 0.5, 0.02, 0.1, 4000.0
    speed = np.linspace(0.5, 2.0, 3001)
    square = (eps * speed**2) ** 2 / ((1.0 - speed**2) ** 2 + (2.0 * zeta * speed) ** 2)
    power = alpha * speed + eta * zeta * speed * square / eps
    top = np.argmax(np.where(speed < 1.02, power, 0.0))
    up, down = power[top], power[top:].min()
    load = (
        "(eps*(Omega^2*cos(psi) + sin(psi)*(u + rate*t - alpha*Omega)) - x - 2*zeta*dx)"
        "/(1 - eps*eta*sin(psi)^2)"
    )
    motor = pk.Term(
        f"{load} + x",
        {"eps": eps, "eta": eta, "zeta": zeta, "alpha": alpha, "u": 0.07, "rate": 0.2 / time},
        states={"psi": "Omega", "Omega": f"u + rate*t - alpha*Omega + eta*sin(psi)*({load})"},
        start={"psi": 0.0, "Omega": 0.7},
    )
    machine = pk.Perturbed(pk.Potential("x^2/2", "x", interval=(-2.0, 2.0)), terms=motor)
    t = np.linspace(0.0, time, 8001)
    rising = pk.flow(machine, 0.0, 0.0, t)
    falling = pk.flow(machine.replace(u=0.27, rate=-0.2 / time), 0.0, 0.0, t, Omega=2.7)
    jumps = []
    for ds, start, slope, past in ((rising, 0.07, 0.2, 1.15), (falling, 0.27, -0.2, 1.05)):
        turns = (ds.motion_psi.values[100:] - ds.motion_psi.values[:-100]) / (t[100] - t[0])
        passed = np.flatnonzero(np.diff(np.sign(turns[400:] - past)))[0] + 450
        jumps.append(start + slope * t[passed] / time)
    # Each comes a little after the fold, for the power goes on.
    assert up < jumps[0] < 1.03 * up
    assert 0.97 * down < jumps[1] < down
    shaken = abs(rising.motion_x.values)
    assert shaken[4800:6400].max() > 0.45  # hung up at the resonance
    assert shaken[-800:].max() < 0.03  # beyond it
