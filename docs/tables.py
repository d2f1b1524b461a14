"""The reference pages that follow from the code: quantities, systems, special points, codes."""

from __future__ import annotations

import inspect
import re
from collections.abc import Iterable, Iterator, Sequence
from enum import IntEnum
from pathlib import Path
from typing import Any

import sympy

import phasekit as pk
from phasekit import errors
from phasekit.bifurcation.special_points import KINDS
from phasekit.labelled.bifurcation_set import CURVES
from phasekit.labels.coordinates import LABELS, STATES
from phasekit.laws.ladder import Conservative, Flow, Law, Map, Routhian, Standing, Trait
from phasekit.laws.trigonometric import Trigonometric
from phasekit.systems.registry import models
from phasekit.systems.system import System
from phasekit.table.quantities import ROWS, TABLE, variant
from phasekit.table.row import LAW, Pass, Quantity

#: What a system has whose law has a trait.
TRAITS = {
    Trait.TORQUED: "a constant torque",
    Trait.DAMPED: "linear or quadratic damping, also negative",
    Trait.DRIVEN: "forcing, modulation, drift, or a parameter that is a function of time",
    Trait.NOISY: "damping and a thermal energy kT",
    Trait.OWN: "a term of one's own, stated by a formula",
    Trait.KINKED: "a force of one's own with a kink, such as of `abs`",
    Trait.JUMPING: "a force of one's own that jumps, such as of `sign`",
    Trait.CODED: "a force of one's own that is a function",
    Trait.STATEFUL: "a term with states of its own",
}


def pages() -> dict[str, str]:
    """The text of each page, by its name."""
    for name in pk.__all__:  # a model is known once its module is loaded
        getattr(pk, name)
    return {
        "quantities": _quantities(),
        "systems": _systems(),
        "special_points": _special_points(),
        "codes": _codes(),
    }


def write(folder: Path) -> None:
    """Write the pages; those that have not changed keep their times."""
    folder.mkdir(exist_ok=True)
    for name, text in pages().items():
        path = folder / f"{name}.md"
        if not path.exists() or path.read_text(encoding="utf-8") != text:
            path.write_text(text, encoding="utf-8")


# ------------------------------------------------------------------------------ Markdown


def plain(text: str) -> str:
    """Text in which nothing is markup."""
    return re.sub(r"([\\`*_\[\]<>$|#])", r"\\\1", text)


def code(text: str) -> str:
    """Text as code, in a table too."""
    return f"`{text}`".replace("|", r"\|") if text else ""


def codes(names: Iterable[str]) -> str:
    """Names as code."""
    return ", ".join(map(code, names))


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A table; columns that are empty throughout are left out."""
    rows = [tuple(row) for row in rows]
    kept = [i for i in range(len(head)) if any(row[i] for row in rows)]
    lines = [
        [head[i] for i in kept],
        ["---"] * len(kept),
        *([row[i] for i in kept] for row in rows),
    ]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def page(*parts: str) -> str:
    """Paragraphs, tables and headings, one below the other."""
    return "\n\n".join(part for part in parts if part) + "\n"


def first_line(thing: Any) -> str:
    """The first line of a docstring."""
    return plain((inspect.getdoc(thing) or "").partition("\n")[0].replace("``", ""))


# ------------------------------------------------------------------------------ quantities


def _quantities() -> str:
    groups = dict.fromkeys(row.group for row in ROWS.values())
    return page(
        "# Quantities",
        "Every row of the table of quantities: what `sweep(of=...)` and the labelled functions "
        "compute, of which laws, and from what. [](../references.md) lists the sources.",
        "## The ladder of laws",
        "A law is a base, which stands on a rung, and the terms that are added to it. A system "
        "says by its rung and by the traits of its terms what can be computed of it; the most "
        "special line that fits answers.",
        "\n".join(_ladder(Law)),
        table(("trait", "where the system has"), [(code(t.name), TRAITS[t]) for t in Trait]),
        *(part for group in groups for part in _group(group)),
        "## Dimensions",
        table(
            ("dim", "meaning", "labels"),
            [(code(d), plain(text), codes(map(str, names))) for d, (names, text) in LABELS.items()],
        ),
        "## States",
        "What quantities may need beside the parameters of a system.",
        table(
            ("state", "units", "meaning"),
            [(code(name), code(units), plain(text)) for name, (units, text) in STATES.items()],
        ),
    )


def _ladder(rung: type[Law], depth: int = 0) -> Iterator[str]:
    if rung.__module__.startswith("phasekit.laws."):
        yield f"{'  ' * depth}- `{rung.__name__}`: {first_line(rung)}"
        for special in rung.__subclasses__():
            if issubclass(special, (Flow, Map)):
                yield from _ladder(special, depth + 1)


def _group(group: str) -> Iterator[str]:
    rows = [row for row in ROWS.values() if row.group == group]
    passes = [one for one in TABLE.passes if group in one.groups]
    yield f"## {group}"
    if passes:
        head = ("of", "from", "named in the call", "may be given", "computed by")
        yield table(head, [_pass(one) for one in passes])
    else:
        yield f"By {{py:obj}}`phasekit.{group}`, which needs an argument of its own."
    rungs = {one.of for one in passes}
    yield table(
        ("quantity", "dims", "units", "meaning", "equation", "source"),
        [_row(row, rungs) for row in rows],
    )


def _pass(one: Pass) -> tuple[str, ...]:
    inputs = ("the parameters" if name == LAW else code(name) for name in one.inputs)
    return (
        plain(one.standing.called),
        ", ".join(inputs),
        codes(one.options),
        codes(state for state, _ in one.optional),
        code(one.function.replace(":", ".") if isinstance(one.function, str) else ""),
    )


def _row(row: Quantity, rungs: set[type[Law] | Standing]) -> tuple[str, ...]:
    meaning = plain(row.long_name)
    if row.flags is not None:
        meaning += f": a code of [{row.flags.__name__}](codes.md)"
    equation = code(row.equation)
    for rung, words in ((Conservative, "in any potential"), (Routhian, "at a kept momentum")):
        own = variant(row, rung).get("equation")
        if rung in rungs and own and own != row.equation:
            equation += f"; {words} {code(own)}"
    return code(row.name), codes(row.dims), code(row.units), meaning, equation, plain(row.source)


# ------------------------------------------------------------------------------ systems


def _systems() -> str:
    return page(
        "# Systems",
        "Every model: its parameters, and its law as it follows from `products`. A function "
        "answers for all systems on the rungs that [](quantities.md) names.",
        *(part for name, cls in models().items() for part in _system(name, cls)),
    )


def _system(name: str, cls: type[System]) -> Iterator[str]:
    yield f"## {name}"
    yield f"{{py:obj}}`phasekit.{name}`: {first_line(cls)}"
    if cls.declared:
        defaults = inspect.signature(cls).parameters
        yield table(
            ("parameter", "unit", "meaning", "domain", "default"),
            [
                (code(p.name), code(p.units), plain(p.long_name), plain(p.wants),
                 "may be left out" if p.optional else _default(defaults.get(p.name)))
                for p in cls.declared
            ],
        )  # fmt: skip
    if cls.rung is Trigonometric:
        yield _law(cls)
        named = codes(cls.critical_values)
        if named:
            yield f"Critical values are in closed form for {named}, `lam` and `psi`."
    else:
        yield f"It is {plain(cls.rung.called)}."


def _default(parameter: inspect.Parameter | None) -> str:
    given = parameter is not None and parameter.default is not inspect.Parameter.empty
    return code(repr(parameter.default)) if parameter is not None and given else ""


def _law(cls: type[System]) -> str:
    law = cls.trigonometric()
    symbols = {name: sympy.Symbol(name, real=True) for name in law.parameters}
    shown = {symbol: _symbol(name) for name, symbol in symbols.items()}
    apart = r" \, "  # of names that are words
    lines = [
        f"{name} &= {sympy.latex(formula, symbol_names=shown, mul_symbol=apart)}"
        for name, formula in zip("ABC", law.formulas(symbols), strict=True)
    ]
    body = " \\\\\n".join(lines)
    return f"$$\n\\begin{{aligned}}\n{body}\n\\end{{aligned}}\n$$"


def _symbol(name: str) -> str:
    """A parameter in a formula: letters as mathematicians write them, words upright."""
    written: str = sympy.latex(sympy.Symbol(name))
    letter = len(name.partition("_")[0].rstrip("0123456789")) == 1 or written.startswith("\\")
    return written if letter else rf"\mathrm{{{name}}}".replace("_", r"\_")


# ------------------------------------------------------------------------------ points, codes


def _special_points() -> str:
    kinds = KINDS.values()
    rows = [
        (code(k.name), code(k.label), plain(k.meaning), codes(k.normal_form), codes(k.found_by))
        for k in kinds
    ]
    found = [(code(k.name), plain(k.test), plain(k.system)) for k in kinds if k.test]
    return page(
        "# Special points",
        "Kinds of special points, and the labels that they bear in pictures and in "
        "`branch.special(...)`. A point of a continuation is a {py:obj}`phasekit.SpecialPoint`.",
        table(("kind", "label", "meaning", "normal form", "found by"), rows),
        "## How they are found",
        "A change of the test function brackets a point; the equations are then solved.",
        table(("kind", "test function", "equations"), found),
        "## Curves in a plane of two parameters",
        "Kinds of the curves that {py:obj}`phasekit.bifurcation_set` finds.",
        table(("kind", "meaning"), [(code(kind), plain(text)) for kind, text in CURVES.items()]),
    )


def _codes() -> str:
    enums = [cls for _, cls in inspect.getmembers(errors, inspect.isclass)
             if issubclass(cls, IntEnum) and cls is not IntEnum]  # fmt: skip
    return page(
        "# Codes",
        "Integer codes are int8 and carry CF `flag_values` and `flag_meanings`. Their names are "
        "enumerations: `ds.kind == pk.EquilibriumKind.SADDLE`.",
        *(part for cls in enums for part in _enum(cls)),
    )


def _enum(cls: type[IntEnum]) -> Iterator[str]:
    held = codes(row.name for row in ROWS.values() if row.flags is cls)
    yield f"## {cls.__name__}"
    holders = f" Held by {held}." if held else ""
    yield f"{{py:obj}}`phasekit.{cls.__name__}`: {first_line(cls)}{holders}"
    yield table(("value", "name"), [(str(one.value), code(one.name.lower())) for one in cls])
