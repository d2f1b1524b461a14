"""Nothing that is opened, drawn or rebuilt from a file is evaluated or unpickled."""

import json
import os
import shutil
import sys
from pathlib import Path

import h5py
import matplotlib.pyplot as plt
import numcodecs
import numpy as np
import pytest
import xarray as xr

import phasekit as pk
from phasekit.cli import main
from phasekit.labelled.continuation.branch import Branch
from phasekit.labelled.continuation.continuation import continuation
from phasekit.systems.problem import Problem

FORBIDDEN = ("os.system", "subprocess.Popen", "os.exec", "os.posix_spawn")


class Watch:
    """Audit events by which what stands in a file could run.

    sympy's lambdify compiles and runs code that it writes itself, of checked expressions; numba
    unpickles its own cache. So compiled text must not hold what the file says, and only what could
    do harm must not be unpickled.
    """

    def __init__(self):
        self.on, self.seen = False, []

    def __call__(self, event, args):
        if not self.on:
            return
        if event in FORBIDDEN:
            self.seen.append((event, args))
        if event == "pickle.find_class" and args[0] in ("os", "posix", "nt", "builtins"):
            self.seen.append((event, args))
        if event == "compile" and "sentinel" in str(args[0]):
            self.seen.append((event, args))

    def __enter__(self):  # noqa: D105
        self.on, self.seen = True, []
        return self

    def __exit__(self, *_):  # noqa: D105
        self.on = False


WATCH = Watch()
sys.addaudithook(WATCH)

WELL = pk.Potential("x^4/4 - mu*x^2/2 + k*x", "x", {"mu": 1.0, "k": 0.1})


@pytest.fixture(scope="module")
def well_map():
    return pk.sweep(WELL, mu=[0.5, 1.0], k=[0.0, 0.1])


@pytest.fixture
def code(tmp_path, monkeypatch):
    """A formula that would write a file, had it been evaluated."""
    monkeypatch.chdir(tmp_path)
    return "mu*x**2/2 + 0*__import__('os').system('touch sentinel')"


def untouched(tmp_path):
    return WATCH.seen == [] and not (tmp_path / "sentinel").exists()


def test_the_watch_sees_what_it_should(tmp_path, code):
    with WATCH:
        eval("__import__('os').system('touch sentinel')")
    assert {event for event, _ in WATCH.seen} >= {"os.system", "compile"}
    assert (tmp_path / "sentinel").exists()


@pytest.mark.parametrize("name", ["map.zarr", "map.nc"])
def test_maps_with_code_for_attributes(well_map, tmp_path, code, name):
    keys = ("expression", "coordinate", "parameters", "period", "interval")
    for number, attribute in enumerate(keys):
        path = f"{number}{name}"
        ds = well_map.assign_attrs({f"phasekit_{attribute}": code})
        if name.endswith(".nc"):
            ds.to_netcdf(path, engine="h5netcdf")
        else:
            ds.to_zarr(path, zarr_format=3, consolidated=False)
        with WATCH, pk.open_map(path) as opened:
            opened.load()
            with pytest.raises(pk.ParameterError, match="^ds: got"):
                opened.phasekit.system()
            repr(opened)
            if not number:
                plt.close(opened.phasekit.plot.parameter_map().figure)
                assert main(["info", path]) == 0
        assert untouched(tmp_path)


@pytest.mark.parametrize("key", ["expression", "coordinate", "parameters", "period", "interval"])
@pytest.mark.parametrize(
    "value",
    [None, 5, b"x", [1.0, 2.0], np.array(["x", "y"]), {}, "x" * 10**6, "1e400 2", "1 2 3", "lambda",
     "nan", "__class__", "x; y", "9**9**9*x", "(" * 10**5],
    ids=lambda value: ascii(value)[:12],
)  # fmt: skip
def test_damaged_attributes_say_what_is_damaged(well_map, key, value):
    ds = well_map.assign_attrs({f"phasekit_{key}": value})
    if value is None:
        del ds.attrs[f"phasekit_{key}"]
    with pytest.raises(pk.ParameterError, match=r"^ds: (got a map|got no coord|attribute phasek)"):
        ds.phasekit.system()


@pytest.mark.parametrize("schema", [None, 1, [1, 1], np.array([1, 2]), "99", "1" * 10**5])
def test_other_schemas_are_refused(well_map, schema):
    ds = well_map.assign_attrs(phasekit_schema=schema)
    with pytest.raises(pk.ParameterError, match="got schema"):
        ds.phasekit.system()


class Evil:
    """What runs when it is unpickled."""

    def __reduce__(self):  # noqa: D105
        return os.system, ("touch sentinel",)


def pickled_store(path, dtype):
    """A Zarr store of format 2, an array of which is encoded by pickle."""
    (path / "x").mkdir(parents=True)
    attrs = {"phasekit_model": "Branch", "phasekit_schema": "1", "branch": "{}"}
    for file, content in {
        ".zgroup": {"zarr_format": 2},
        ".zattrs": attrs,
        "x/.zattrs": {"_ARRAY_DIMENSIONS": ["x"]},
        "x/.zarray": {
            "zarr_format": 2, "shape": [1], "chunks": [1], "dtype": dtype, "compressor": None,
            "fill_value": None, "order": "C", "filters": [{"id": "pickle", "protocol": 5}],
        },
    }.items():  # fmt: skip
        (path / file).write_text(json.dumps(content))
    (path / "x" / "0").write_bytes(numcodecs.Pickle().encode(np.array([Evil()], dtype=object)))


@pytest.mark.parametrize("dtype", ["|O", "<f8"])
def test_stores_of_format_2_are_not_opened(tmp_path, code, monkeypatch, capsys, dtype):
    monkeypatch.setattr(numcodecs.pickles, "ALLOW_UNSAFE_PICKLE_DECODE", True, raising=False)
    store = tmp_path / "map.zarr"
    pickled_store(store, dtype)
    with WATCH:
        with pytest.raises(pk.StoreError, match="^store: "):
            pk.open_map(store).load()
        with pytest.raises(pk.StoreError, match="^path: "):
            Branch.load(store)
        assert main(["info", str(store)]) == 2
        with pytest.raises(pk.StoreError):
            pk.sweep(pk.Pendulum(g=9.81, length=1.0), length=[1.0, 2.0], store=store)
    assert capsys.readouterr().err
    assert untouched(tmp_path)


def test_recipes_with_code(tmp_path, code, capsys):
    recipe = tmp_path / "map.toml"
    for text in (
        f'model = "Potential"\nexpression = "{code}"\naxes.mu = [1.0]\n',
        f'model = "{code}"\naxes.lam = [1.0]\n',
        f'model = "Reduced"\nparameters.lam = "{code}"\naxes.psi = [0.1]\n',
        f'model = "Reduced"\naxes.lam = ["{code}"]\n',
        f'model = "Reduced"\naxes.lam = {{from = 0, to = "{code}", count = 2}}\n',
        f'model = "Reduced"\naxes.lam = {{from = 0, to = 1, count = 0x1{"0" * 5000}}}\n',
        f'model = "Reduced"\nparameters.lam = 0x1{"0" * 5000}\naxes.psi = [0.1]\n',
    ):
        recipe.write_text(text)
        with WATCH:
            assert main(["sweep", str(recipe), "--store", "out.zarr"]) == 2
        assert capsys.readouterr().err.startswith("phasekit: ")
        assert untouched(tmp_path)


# --------------------------------------------------------------------- branches


@pytest.fixture(scope="module")
def branch():
    problem = Problem("mu + l*x - x**3", "x", {"mu": -1.0, "l": 1.0})
    return continuation(problem, "mu", x0=[-1.3], span=(-1.0, 1.0))


@pytest.fixture(scope="module")
def stored(branch, tmp_path_factory):
    """A saved branch, without the points, which are not read."""
    path = tmp_path_factory.mktemp("saved") / "branch.nc"
    branch.save(path)
    with xr.open_dataset(path, engine="h5netcdf") as opened:
        ds = opened[[name for name in opened if str(name).startswith("raw_")]].load()
    for variable in ds.variables.values():
        variable.encoding = {}
    ds.encoding = {}
    ds.drop_vars(ds.coords).to_netcdf(path, engine="h5netcdf")
    return path


def altered(stored, path, change=None, attributes=None, arrays=None):
    """Copy a saved branch with a changed specification, other attributes or arrays."""
    shutil.copy(stored, path)
    with h5py.File(path, "r+") as file:
        if change is not None:
            spec = json.loads(file.attrs["branch"])
            changed = change(spec)
            file.attrs["branch"] = changed if isinstance(changed, str) else json.dumps(spec)
        for name, value in (attributes or {}).items():
            del file.attrs[name]
            if value is not None:
                file.attrs[name] = value
    if arrays is not None:
        with xr.open_dataset(path, engine="h5netcdf") as opened:
            ds = opened.load()
        ds = ds.drop_vars(list(arrays))
        ds.encoding = {}
        for name, value in arrays.items():
            if value is not None:
                ds[name] = (tuple(f"new_{name}_{k}" for k in range(np.ndim(value))), value)
        ds.to_netcdf(path, engine="h5netcdf")
    return path


def test_what_is_altered_below_is_a_branch(branch, stored, tmp_path):
    path = altered(stored, tmp_path / "branch.nc", lambda spec: None)
    assert Branch.load(path).points.identical(branch.points)


def put(*keys):
    *path, last, value = keys

    def change(spec):
        for key in path:
            spec = spec[key]
        spec[last] = value

    return change


def drop(*keys):
    *path, last = keys

    def change(spec):
        for key in path:
            spec = spec[key]
        del spec[last]

    return change


CODE = "0*__import__('os').system('touch sentinel')"
CHANGES = {
    "code": put("problem", "f", [f"mu + {CODE}"]),
    "code as a state": put("problem", "state", [f"x or {CODE}"]),
    "code as a parameter": put("problem", "parameters", {CODE: 1.0, "l": 1.0}),
    "code as a model": put("problem", "system", CODE),
    "an unknown model": put("problem", "system", "Model"),
    "a model as a list": put("problem", "system", ["Potential"]),
    "a potential of code": lambda spec: spec["problem"].update(
        system="Potential",
        system_parameters={"expression": f"mu*x + {CODE}", "coordinate": "x"},
    ),
    "arguments that are none": lambda spec: spec["problem"].update(
        system="Pendulum", system_parameters={"__class__": 1}
    ),
    "arguments that are a list": lambda spec: spec["problem"].update(
        system="Pendulum", system_parameters=[1, 2]
    ),
    "a huge power": put("problem", "f", ["mu + 9**9**9*x"]),
    "no formula": put("problem", "f", [None]),
    "formulas in formulas": put("problem", "f", [["x"]]),
    "too many formulas": put("problem", "f", ["x", "x"]),
    "another number of states": lambda spec: spec["problem"].update(f=["x", "y"], state=["x", "y"]),
    "periods": put("problem", "periods", {"x": "two"}),
    "conservative": put("problem", "conservative", "yes"),
    "no problem": drop("problem"),
    "a null problem": put("problem", None),
    "a problem as a list": put("problem", []),
    "no state": drop("problem", "state"),
    "no free": drop("free"),
    "unknown free": put("free", ["nu"]),
    "two free": put("free", ["mu", "l"]),
    "free as code": put("free", [CODE]),
    "an unknown kind": put("kind", CODE),
    "a kind of other size": put("kind", "hopf"),
    "a kind as a list": put("kind", []),
    "options as text": put("options", CODE),
    "unknown options": put("options", "color", "red"),
    "an option of text": put("options", "max_step", "0.1"),
    "an option of nothing": put("options", "bounds", None),
    "detect": put("options", "detect", [CODE]),
    "stops": put("stops", [[1, 2], [3, 4]]),
    "one stop": put("stops", [None]),
    "stops as text": put("stops", "ab"),
    "record": put("record", []),
    "no json": lambda spec: "{",
    "json of a number": lambda spec: "5",
    "json that is deep": lambda spec: "[" * 10**5,
    "json of nothing": lambda spec: "null",
}


@pytest.mark.parametrize("name", CHANGES)
def test_damaged_branches_say_what_is_damaged(stored, tmp_path, monkeypatch, name):
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "branch.nc"
    altered(stored, path, CHANGES[name])
    with WATCH, pytest.raises(pk.StoreError, match=r"branch\.nc is damaged: ") as caught:
        Branch.load(path)
    assert untouched(tmp_path)
    assert len(str(caught.value)) < 1000


ARRAYS = {
    "raw_forward": [None, np.zeros((3, 2)), np.full((3, 9), np.nan), np.zeros(5)],
    "raw_forward_state": [None, np.zeros(3), np.array(["a"], dtype=object)],
    "raw_start_u": [np.zeros(1), np.array(0.0), np.zeros(2, np.int64)],
    "raw_start_slopes": [np.zeros((2, 1))],
    "raw_curve_par": [np.zeros(1), np.array([np.nan, 0.0])],
    "raw_curve_scale": [np.zeros(2), -np.ones(2), np.ones(1000)],
    "raw_curve_aux": [np.ones(3)],
}


@pytest.mark.parametrize(
    ("name", "value"), [(name, value) for name, values in ARRAYS.items() for value in values]
)
def test_arrays_of_the_wrong_size_never_reach_compiled_code(stored, tmp_path, name, value):
    path = tmp_path / "branch.nc"
    altered(stored, path, arrays={name: value})
    with pytest.raises(pk.StoreError, match="is damaged"):
        Branch.load(path)


def test_a_small_file_cannot_ask_for_all_memory(branch, tmp_path):
    path = tmp_path / "branch.zarr"
    branch.save(path)
    for name in ("raw_forward", "raw_forward_slopes"):
        file = path / name / "zarr.json"
        meta = json.loads(file.read_text())
        meta["shape"][0] = 10**10
        file.write_text(json.dumps(meta))
    with pytest.raises(pk.StoreError, match=r"is damaged: .*bytes in a file of"):
        Branch.load(path)


@pytest.mark.parametrize("attribute", ["branch", "phasekit_model", "phasekit_schema"])
@pytest.mark.parametrize("value", [None, 5, [1.0, 2.0], "text", "1" * 10**4])
def test_damaged_attributes_of_branches(stored, tmp_path, attribute, value):
    path = altered(stored, tmp_path / "branch.nc", attributes={attribute: value})
    with pytest.raises(pk.StoreError, match="^path: .*(damaged|holds no branch|schema)"):
        Branch.load(path)


@pytest.mark.parametrize("path", ["", "a\0b", None, 5, b"x", "~nobody-there/x.zarr"])
def test_paths_that_are_none(path):
    with pytest.raises(pk.ParameterError, match="^path: got"):
        Branch.load(path)


@pytest.mark.parametrize("content", [b"", b"CDF\x01", b"\x89HDF\r\n\x1a\n" + b"\0" * 200, b"{}"])
def test_files_that_are_no_branch(tmp_path, content):
    path = tmp_path / "branch.nc"
    path.write_bytes(content)
    with pytest.raises(pk.StoreError, match="cannot be read"):
        Branch.load(path)


def test_numbers_of_formulas_are_saved_to_the_last_digit(tmp_path):
    import sympy as sp

    x, mu = sp.symbols("x mu")
    third = 1 / 3
    problem = Problem(mu - sp.Float(third) * x, "x", {"mu": 0.1})
    line = continuation(problem, "mu", x0=[0.3], span=(0.0, 1.0))
    line.save(tmp_path / "line.zarr")
    loaded = Branch.load(tmp_path / "line.zarr")
    assert loaded.problem([1.0]) == problem([1.0])
    assert loaded.points.identical(line.points)


def test_a_branch_of_the_first_layout_opens_and_goes_on():
    """Version 0.1.0 of 2026-11 kept the derivatives of f between tangents and step data."""
    old = pk.Branch.load(Path(__file__).parents[1] / "data" / "branch_layout1.nc")
    problem = pk.Problem("mu + x - x**3", state="x", parameters={"mu": -1.0})
    options = pk.ContinuationOptions(max_points=15)
    new = pk.continuation(problem, "mu", x0=[-1.3], span=(-1, 1), options=options)
    assert old.points.sizes["point"] == 16 <= new.points.sizes["point"]
    x, mu = old.points.x.values, old.points.mu.values
    assert np.abs(mu + x - x**3).max() < 1e-14
    longer = old.extend(400)
    assert longer.points.mu.values[-1] == 1.0
    folds = [point.parameters["mu"] for point in longer.special("fold")]
    np.testing.assert_allclose(sorted(folds), [-2 / 27**0.5, 2 / 27**0.5], rtol=1e-13)
