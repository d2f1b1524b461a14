"""Sections of docstrings that are not written by hand, because something else knows them."""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable, Mapping
from typing import Any, TypeVar

T = TypeVar("T", bound=type)

#: What may follow a section, in the order in which numpydoc wants them.
_REST = ("Warns", "See Also", "Notes", "References", "Examples")
_BEHIND = {
    "Parameters": ("Returns", "Attributes", "Raises", *_REST),
    "Returns": ("Raises", *_REST),
    "Raises": _REST,
}
#: What a function returns that does not say it, by the type in its signature.
_RETURNS = {
    "Axes": "matplotlib.axes.Axes",
    "Numbers": "float or ndarray\n    Shape (...).",
    "States": "float, ndarray or xarray.DataArray\n    As the states.",
    "Vectors": "ndarray\n    Shape (..., 3).",
}
#: What arguments of public functions mean that do not say it, by their names.
WORDS: Mapping[str, str] = {
    "system": "system : system\n    Any system.",
    "phi": "phi : float, 1-D array_like or xarray.DataArray\n    Angles in rad.",
    "phi0, dphi0": """phi0, dphi0 : float, 1-D array_like or xarray.DataArray
    States at t = 0: angles in rad, angular velocities in s^-1.""",
    "rtol, atol": "rtol, atol : float, optional\n    As in `flow`.",
    "states": "**states\n    The states of a `Problem` by name, in place of `x0`.",
    "angles": 'angles : {"rad", "deg"}\n    Unit in which angles are shown.',
    "units": """units : mapping of str to str, optional
    Units in which quantities and parameters are shown, by name: ``{"phi": "deg", "a": "mm"}``.""",
    "cut": """cut : float, optional
    Where the circle is cut open, in the unit in which the angle is shown; at half a turn if
    left out. What lies on the cut is drawn at both ends.""",
    "legend": """legend : bool
    Whether to explain lines and markers under the axes. A given figure without layout engine
    gets the constrained one then.""",
    "ax": "ax : matplotlib.axes.Axes, optional\n    Where to draw; a new figure if left out.",
}


def completed(
    function: Callable[..., Any],
    words: Mapping[str, str] = WORDS,
    result: str = "",
    raises: str = "",
) -> str | None:
    r"""The docstring of a function, with what it leaves unsaid of arguments, result and errors.

    >>> def draw(top: float, *, ax: object = None) -> None:
    ...     '''Draw it.'''
    >>> completed(draw)[:62]
    'Draw it.\n\nParameters\n----------\nax : matplotlib.axes.Axes, opt'
    >>> def moment() -> "Vectors":
    ...     '''Of it.\n\nReturns\n-------\nndarray\n    Of its own.'''
    >>> completed(moment) == moment.__doc__
    True
    """
    doc, signature = function.__doc__, inspect.signature(function)
    if doc is None:  # Python runs without docstrings
        return None
    _, own, _ = _parts(doc, "Parameters")
    entries = re.split(r"\n(?=\S)", own) if own else []
    order, said = list(signature.parameters), {n for one in entries for n in _named(one)}
    for names, text in words.items():
        meant = names.split(", ")
        if not said.isdisjoint(meant) or not {*meant} <= {*order}:
            continue
        behind = {*order[order.index(meant[0]) :]}
        at = next((k for k, one in enumerate(entries) if _named(one)[0] in behind), len(entries))
        entries.insert(at, text)
        said.update(meant)
    if not result and not _parts(doc, "Returns")[1]:
        result = _RETURNS.get(str(signature.return_annotation), "")
    for title, text in (("Returns", result), ("Raises", raises)):
        if text and text.partition("\n")[0] not in _parts(doc or "", title)[1]:
            doc = with_section(doc, title, text)
    return with_section(doc, "Parameters", "\n".join(entries), instead=True) if entries else doc


def explained(words: Mapping[str, str], *, result: str = "", raises: str = "") -> Callable[[T], T]:
    """Complete the docstrings of the public methods of a class; ``{name}`` in words is theirs."""

    def complete(cls: T) -> T:
        for name, function in vars(cls).items():
            if inspect.isfunction(function) and not name.startswith("_"):
                own = {names: text.format(name=name) for names, text in words.items()}
                function.__doc__ = completed(function, own, result, raises)
        return cls

    return complete


def inherit_sections(cls: type) -> None:
    """Complete the docstrings of methods that replace others by what those say."""
    for name, one in vars(cls).items():
        function = getattr(one, "__func__", one)
        if name.startswith("_") or not inspect.isfunction(function):
            continue
        replaced = getattr(super(cls, cls), name, None)
        for title in ("Parameters", "Returns", "Raises") if replaced is not None else ():
            text = _parts(replaced.__doc__ or "", title)[1]
            if text and not _parts(function.__doc__ or "", title)[1]:
                function.__doc__ = with_section(function.__doc__, title, text)


def with_section(doc: str | None, title: str, text: str, *, instead: bool = False) -> str | None:
    r"""Put a text in front of, or instead of, what a section says; make it where none is.

    What the section has by hand begins with the same line, the type, which stays the first.

    >>> with_section("Half of it.\n\nNotes\n-----\nExact.", "Returns", "float")
    'Half of it.\n\nReturns\n-------\nfloat\n\nNotes\n-----\nExact.'
    """
    if doc is None:  # Python runs without docstrings
        return None
    before, own, after = _parts(doc, title)
    first, _, rest = own.partition("\n")
    own = "" if instead else rest if first == text.partition("\n")[0] else own
    between = "\n\n" if own[:1] == " " else "\n"  # goes on with a type, or is of another
    body = between.join(filter(None, (text, own)))
    return f"{before}\n\n{_headed(title)}{body}{after}"


def _parts(doc: str, title: str) -> tuple[str, str, str]:
    """What stands before a section, in it, and behind it, which begins with an empty line."""
    doc = inspect.cleandoc(doc)
    heads = [match.start() for match in re.finditer(r"\n\n[A-Z][A-Za-z ]+\n-{3,}\n", doc)]
    at = doc.find(f"\n\n{_headed(title)}")
    if at < 0:
        later = [k for k in heads if doc[k:].lstrip("\n").partition("\n")[0] in _BEHIND[title]]
        at = min(later, default=len(doc))
        return doc[:at], "", doc[at:]
    start = at + 2 + len(_headed(title))
    end = min((k for k in heads if k > at), default=len(doc))
    return doc[:at], doc[start:end], doc[end:]


def _named(entry: str) -> list[str]:
    """Names of the arguments of which an entry speaks."""
    return [name.strip(" *") for name in entry.partition("\n")[0].partition(" :")[0].split(",")]


def _headed(title: str) -> str:
    return f"{title}\n{'-' * len(title)}\n"
