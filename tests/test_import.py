"""Importing phasekit is cheap, and its public names are complete."""

import ast
import importlib.metadata
import inspect
import subprocess
import sys

import pytest

import phasekit as pk

HEAVY = (
    "numpy", "numba", "llvmlite", "scipy", "sympy", "xarray", "matplotlib", "pandas", "dask",
    "zarr", "tqdm",
)  # fmt: skip


def loaded_after(code):
    program = f"{code}\nimport sys\nprint([m for m in {HEAVY!r} if m in sys.modules])"
    result = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True
    )
    return ast.literal_eval(result.stdout.splitlines()[-1])


@pytest.mark.parametrize(
    "code",
    [
        "import phasekit",
        "import phasekit as pk; dir(pk); pk.deg; pk.rpm; pk.__version__",
        "import phasekit as pk; pk.ParameterError; pk.Topology.FIGURE_EIGHT",
        "import phasekit as pk\ntry:\n    pk.no_such_name\nexcept AttributeError:\n    pass",
    ],
)
def test_import_loads_nothing_heavy(code):
    assert loaded_after(code) == []


@pytest.mark.slow
def test_labelled_floor_loads_neither_plots_nor_stores_nor_dask():
    """Nor are other names listed then than public ones."""
    code = (
        "import phasekit as pk; pk.equilibria; pk.sweep; pk.open_map; pk.GyroRotorDisk\n"
        "assert sorted(set(dir(pk)) - set(pk.__all__)) == []\n"
    )
    assert set(loaded_after(code)) <= {"numpy", "xarray", "pandas"}


@pytest.mark.slow
def test_first_result_does_not_load_dask():
    code = (
        "import phasekit as pk\n"
        "disk = pk.GyroRotorDisk(beta=0.3, e=0.0115, a=0.02, r=0.21, omega1=2.5)\n"
        "assert pk.equilibria(disk).n_equilibria.item() == 4\n"
        "import sys\n"
        "assert 'dask.array' not in sys.modules\n"
    )
    assert not {"matplotlib", "zarr", "tqdm"} & set(loaded_after(code))


@pytest.mark.slow
def test_dask_is_loaded_when_there_are_arrays_of_it():
    """Of all arrays xarray asks whether they are dask's: after phasekit, without loading dask."""
    code = """
import sys
import numpy as np, phasekit as pk, xarray as xr
disk = pk.GyroRotorDisk(beta=0.3, e=0.0115, a=0.02, r=0.21, omega1=2.5)
ds = pk.sweep(disk, beta=np.linspace(0.1, 1.4, 6))
pk.plot.parameter_map(pk.sweep(disk, beta=np.linspace(0.1, 1, 4), a=[0.01, 0.02]), "topology")
assert ds.n_equilibria.chunks is None
assert ds.isel(beta=slice(2)).n_equilibria.astype(float).mean().item() > 1
assert "dask.array" not in sys.modules
lazy = ds.chunk(beta=3).n_equilibria
assert lazy.chunks == ((3, 3),) and "dask.array" in sys.modules
assert (lazy.mean() == ds.n_equilibria.mean()).compute().item()
assert xr.DataArray(lazy.data).chunks == ((3, 3),)
from xarray.namedarray import pycompat
import dask, dask.array
assert pycompat.array_type("dask") == (dask.array.Array,)
assert str(pycompat.mod_version("dask")) == dask.__version__.split("+")[0]
"""
    subprocess.run([sys.executable, "-c", code], check=True)


@pytest.mark.parametrize("name", sorted(set(pk.__all__) - {"plot"}))
def test_every_public_name_is_there(name):
    assert getattr(pk, name) is getattr(pk, name)
    assert (name in dir(pk)) ^ (name in dir(pk.extend)) or name == "__version__"


def test_what_a_user_needs_is_listed():
    """The rest is reached by its name, and listed where extensions are made."""
    assert 40 <= len(dir(pk)) <= 52
    assert len(dir(pk)) == len(set(dir(pk)))
    assert pk.extend.StonerWohlfarth is pk.StonerWohlfarth
    assert pk.extend.Topology is pk.Topology
    assert dir(pk.units) == sorted(pk.units.__all__)
    with pytest.raises(AttributeError, match="did you mean 'RigidBody'"):
        pk.extend.RigidBodi  # noqa: B018


@pytest.mark.parametrize(
    "name", sorted(set(pk.__all__) - {"extend", "plot", "units", "deg", "rpm", "__version__"})
)
def test_help_has_an_example_that_runs(name):
    """The doctests of the suite run it."""
    thing = getattr(pk, name)
    assert ">>> " in inspect.getdoc(thing)
    assert thing.__module__.startswith("phasekit.")


def test_pictures_and_what_maps_can_do_have_examples():
    from phasekit.labelled.accessor import MapPlots, PhasekitAccessor

    for name in pk.plot.__all__:
        assert ">>> " in inspect.getdoc(getattr(pk.plot, name)), name
    methods = [m for n, m in inspect.getmembers(PhasekitAccessor) if not n.startswith("_")]
    assert len(methods) > 4
    for method in methods:
        if inspect.isfunction(method):
            assert ">>> " in inspect.getdoc(method), method
    assert ">>> " in inspect.getdoc(MapPlots)


def test_type_checkers_see_the_same_names():
    tree = ast.parse(inspect.getsource(pk))
    block = next(
        node
        for node in tree.body
        if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING"
    )
    seen = {alias.asname for node in block.body for alias in node.names}
    assert seen == set(pk.__all__) - {"__version__", "deg", "rpm"}


@pytest.mark.slow
@pytest.mark.parametrize(
    "call",
    [
        "pk.branches(pk.Reduced(0.0, 0.0), 'lam', (0, 1.5)).phi",
        "pk.critical(pk.Reduced(0.4, 0.1), 'lam').critical_fold",
        "pk.quasi_static(pk.Reduced(0.4, 0.1), lam=[0.0, 0.1]).phi",
    ],
)
def test_each_function_works_alone(call):
    code = f"import phasekit as pk; print({call}.size > 0)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert (done.stdout, done.stderr) == ("True\n", "")


def test_unknown_name():
    with pytest.raises(AttributeError, match="module 'phasekit' has no attribute 'equilibrio'"):
        pk.equilibrio  # noqa: B018


@pytest.mark.parametrize(
    ("wrong", "right"),
    [
        ("equilibrio", "equilibria"),
        ("seperatrices", "separatrices"),
        ("gyrorotordisk", "GyroRotorDisk"),
        ("Stoner_Wohlfarth", "StonerWohlfarth"),
        ("orbit", "orbits"),
    ],
)
def test_misspelt_names_get_the_nearest(wrong, right):
    with pytest.raises(AttributeError, match=f"{wrong!r}; did you mean {right!r}"):
        getattr(pk, wrong)
    with pytest.raises(AttributeError, match="no attribute 'wavelet'$"):
        pk.wavelet  # noqa: B018


def test_constants():
    assert 180 * pk.deg == 3.141592653589793
    assert 60 * pk.rpm == 2 * 3.141592653589793


def test_version_is_that_of_the_package():
    try:
        installed = importlib.metadata.version("phasekit")
    except importlib.metadata.PackageNotFoundError:
        pytest.skip("phasekit is run from its folder")
    assert pk.__version__ == installed


@pytest.mark.slow
def test_maps_that_plain_xarray_opens_have_the_accessor():
    """Where xarray is there first, importing phasekit is enough."""
    code = "import xarray as xr, phasekit; print(hasattr(xr.Dataset(), 'phasekit'))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "True"


@pytest.mark.slow
def test_first_answers_need_neither_symbols_nor_scipy():
    """All of them after each other, so that none of them does."""
    code = """
import numpy as np, phasekit as pk
disk = pk.GyroRotorDisk(beta=0.3, e=0.0115, a=0.02, r=0.21, omega1=2.5)
pk.capture(pk.Perturbed(pk.Pendulum(length=9.81), damping=0.1))
rotor = pk.Pendulum(length=9.81)
pk.melnikov(pk.Perturbed(rotor, damping=0.2, forcing=pk.Harmonic(0.5, 0.7)))
pk.sweep(disk, beta=np.linspace(0, 1.5, 5))
pk.plot.phase_portrait(disk)
"""
    assert not {"sympy", "scipy"} & set(loaded_after(code))


@pytest.mark.slow
def test_pictures_keep_their_names_beside_their_files():
    code = (
        "import phasekit as pk, phasekit.plot.periods, phasekit.plot.branch_surface\n"
        "from phasekit.plot.basins import basins\n"
        "assert pk.plot.basins is basins\n"
        "assert len(pk.plot.__all__) > 20\n"
        "assert all(callable(getattr(pk.plot, name)) for name in pk.plot.__all__)\n"
        "assert dir(pk.plot) == sorted(pk.plot.__all__)\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True)
