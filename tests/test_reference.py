"""Every public name has a page and an example that runs; every row of the tables has its line."""

import importlib.util
import inspect
import re
from enum import IntEnum
from pathlib import Path

import pytest

import phasekit as pk
from phasekit.bifurcation.special_points import KINDS
from phasekit.laws.trigonometric import Trigonometric
from phasekit.systems.registry import models
from phasekit.table.quantities import ROWS, TABLE

DOCS = Path(__file__).parents[1] / "docs"
#: What has no docstring of its own: numbers, a string, a module.
PLAIN = {"__version__", "deg", "extend", "plot", "rpm", "units"}


@pytest.fixture(scope="module")
def tables():
    spec = importlib.util.spec_from_file_location("tables", DOCS / "tables.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def pages(tables):
    return tables.pages()


def listed():
    """Names with a page of their own: entries of the lists of docs/api.md."""
    text = (DOCS / "api.md").read_text(encoding="utf-8")
    blocks = re.findall(r":toctree: generated\n\n(.*?)```", text, re.DOTALL)
    return [name for block in blocks for name in block.split()]


def find(name):
    thing = pk
    for part in name.split("."):
        if inspect.ismodule(thing) and not hasattr(thing, part):
            importlib.import_module(f"{thing.__name__}.{part}")
        thing = getattr(thing, part)
    return thing


def examples(thing):
    """The lines of a docstring that run."""
    doc = thing.__doc__ or ""
    return "\n".join(line for line in doc.splitlines() if line.lstrip().startswith((">>>", "...")))


def methods(cls):
    """Public methods that a class has of phasekit, not those of int, tuple or Exception."""
    for name in dir(cls):
        raw = inspect.getattr_static(cls, name)
        function = getattr(raw, "__func__", raw)
        if not name.startswith("_") and inspect.isfunction(function):
            if function.__module__.startswith("phasekit"):
                yield name


def is_shown(cls, name):
    """Whether a method, or a class that has it, shows in an example how it is called."""
    owners = [owner for owner in cls.__mro__ if hasattr(owner, name)]
    own = [owner.__dict__[name] for owner in owners if name in owner.__dict__]
    calls = any(re.search(rf"\.{name}\(", examples(owner)) for owner in owners)
    return calls or any(examples(getattr(raw, "__func__", raw)) for raw in own)


def test_every_public_name_has_a_page():
    names = listed()
    assert len(names) == len(set(names))
    wanted = {*pk.__all__} - PLAIN | {f"plot.{name}" for name in pk.plot.__all__}
    assert len(wanted) > 60
    assert wanted <= set(names), sorted(wanted - set(names))
    assert {"labelled.accessor.PhasekitAccessor", "labelled.accessor.MapPlots"} <= set(names)
    text = (DOCS / "api.md").read_text(encoding="utf-8")
    assert all(f"`pk.{name}`" in text for name in PLAIN - {"plot"})


@pytest.mark.parametrize("name", listed())
def test_everything_with_a_page_has_an_example(name):
    thing = find(name)
    assert examples(thing), name
    if inspect.isclass(thing):
        bare = [method for method in methods(thing) if not is_shown(thing, method)]
        assert not bare, f"{name}: no example of {', '.join(bare)}"


def sections(doc):
    """Sections of a numpydoc docstring, by their titles."""
    parts = re.split(r"^([A-Z][A-Za-z ]+)\n-{3,}\n", inspect.cleandoc(doc or ""), flags=re.M)
    return dict(zip(parts[1::2], parts[2::2], strict=True))


def named(section):
    """Names that a section of parameters or results declares."""
    heads = re.findall(r"^(\S[^:\n]*?)(?: :.*)?$", section, re.M)
    return {name.strip(" *") for head in heads for name in head.split(",")}


def undocumented(function, docs):
    """Arguments that no docstring names, and "Returns" where what comes back is not said."""
    signature = inspect.signature(function)
    said = [sections(doc) for doc in docs]
    known = {name for one in said for name in named(one.get("Parameters", ""))}
    silent = signature.return_annotation in (None, "None")
    missing = [name for name in signature.parameters if name not in {"self", "cls"} | known]
    if not silent and not any({"Returns", "Yields"} & set(one) for one in said):
        missing.append("Returns")
    return missing


@pytest.mark.parametrize("name", listed())
def test_arguments_and_results_are_explained(name):
    thing = find(name)
    if not inspect.isclass(thing):
        assert not undocumented(thing, [thing.__doc__])
        return
    if "Parameters" in sections(thing.__doc__):  # not made by phasekit alone
        made = thing.__init__ if "__init__" in vars(thing) else thing.__new__
        made = thing if "__signature__" in vars(thing) else made
        assert not undocumented(made, [thing.__doc__, "Returns\n-------\nIt"])
    lacking = {}
    for method in methods(thing):
        raw = inspect.getattr_static(thing, method)
        # An override of a law repeats the words of its base.
        owners = [o.__dict__[method] for o in thing.__mro__ if method in o.__dict__]
        owners = owners if method == "products" else owners[:1]
        docs = [getattr(one, "__func__", one).__doc__ for one in owners]
        if missing := undocumented(getattr(raw, "__func__", raw), docs):
            lacking[method] = missing
    assert not lacking


def test_what_is_not_explained_is_found():
    def half(x, y, *more, **rest) -> int:
        """Say something.

        Parameters
        ----------
        x : float
            A number: not y.
        *more
            Others.
        """

    assert undocumented(half, [half.__doc__]) == ["y", "rest", "Returns"]


def test_an_example_is_missed_where_there_is_none():
    class Bare:
        """Says nothing.

        >>> Bare().shown()
        """

        def shown(self):
            """Is shown above."""

        def alone(self):
            """Is not."""

    assert [is_shown(Bare, name) for name in ("shown", "alone")] == [True, False]


def test_all_pages_are_linked(pages):
    reference = (DOCS / "reference.md").read_text(encoding="utf-8")
    api = (DOCS / "api.md").read_text(encoding="utf-8")
    for name in pages:
        assert f"\ngenerated/{name}\n" in reference
        assert f"(generated/{name}.md)" in api


def cells(line):
    return [cell.strip().replace(r"\|", "|") for cell in re.split(r"(?<!\\)\|", line)[1:-1]]


def test_each_row_of_the_table_is_on_its_page_with_its_group(pages):
    sections = dict(re.findall(r"^## (\w+)\n(.*?)(?=^## |\Z)", pages["quantities"], re.M | re.S))
    assert len(ROWS) > 80
    for row in ROWS.values():
        (line,) = re.findall(rf"^\| `{row.name}` \|.*$", sections[row.group], re.MULTILINE)
        found = cells(line)
        assert f"`{row.units}`" in found
        assert any(cell.startswith(f"`{row.equation}`") for cell in found)
        assert all(f"`{dim}`" in line for dim in row.dims)
    for one in TABLE.passes:
        for group in one.groups:
            (line,) = (
                x
                for x in sections[group].splitlines()
                if x.endswith(f"`{one.function.replace(':', '.')}` |") and one.standing.called in x
            )
            assert all(f"`{name}`" in line for name in one.inputs if name != "law")


def test_tables_have_as_many_cells_in_each_line(pages):
    for text in pages.values():
        for block in re.findall(r"(?:^\|.*\|\n)+", text, re.MULTILINE):
            widths = {len(cells(line)) for line in block.splitlines()}
            assert len(widths) == 1
            assert widths.pop() > 1


def test_each_system_has_its_parameters_and_its_law(pages, tables):
    sections = dict(re.findall(r"^## (\w+)\n(.*?)(?=^## |\Z)", pages["systems"], re.M | re.S))
    assert set(sections) == {name for name in models() if hasattr(pk, name)}
    for name, cls in models().items():
        for parameter in cls.declared:
            (line,) = re.findall(rf"^\| `{parameter.name}` \|.*$", sections[name], re.MULTILINE)
            assert f"`{parameter.units}`" in line
            assert tables.plain(parameter.wants) in line
        assert ("A &= " in sections[name]) == (cls.rung is Trigonometric)
    assert r"B &= \frac{g}{\mathrm{length}}" in sections["Pendulum"]
    assert "| mass of the disk | a number \\> 0 in kg |  |" in sections["FreeGyroRotor"]


def test_every_kind_of_special_point_has_a_line(pages):
    assert {"fold": "LP", "hopf": "H", "no_force": "NF"}.items() <= {
        kind.name: kind.label for kind in KINDS.values()
    }.items()
    for kind in KINDS.values():
        assert f"| `{kind.name}` | `{kind.label}` |" in pages["special_points"]


def test_every_code_has_a_line(pages):
    enums = [thing for name in pk.__all__ if inspect.isclass(thing := getattr(pk, name))]
    enums = [thing for thing in enums if issubclass(thing, IntEnum)]
    assert len(enums) == 13
    for cls in enums:
        section = pages["codes"].partition(f"## {cls.__name__}\n")[2].partition("\n## ")[0]
        lines = [f"| {one.value} | `{one.name.lower()}` |" for one in cls]
        assert [x for x in section.splitlines() if re.match(r"\| -?\d", x)] == lines


def test_a_map_of_a_free_rotor_without_its_mass_says_so():
    disk = pk.GyroRotorDisk(beta=1.0, e=0.1, a=0.05, r=0.1, omega1=6.0, m=2.0)
    ds = pk.sweep(pk.FreeGyroRotor(disk, 0.02), momentum=[0.0, 0.1])
    with pytest.raises(pk.ParameterError, match="no coordinate 'm'"):
        ds.drop_vars("m").phasekit.system()
