"""Sections of docstrings that are not written by hand, because something else knows them."""

from __future__ import annotations

import inspect

#: What may follow a section, in the order in which numpydoc wants them.
_BEHIND = {
    "Returns": ("Raises", "Warns", "See Also", "Notes", "References", "Examples"),
    "Raises": ("Warns", "See Also", "Notes", "References", "Examples"),
}


def with_section(doc: str | None, title: str, text: str) -> str | None:
    r"""Put a text in front of what a section of a docstring says; make the section where none is.

    What the section has by hand begins with the same line, the type, which stays the first.

    >>> with_section("Half of it.\n\nNotes\n-----\nExact.", "Returns", "float")
    'Half of it.\n\nReturns\n-------\nfloat\n\nNotes\n-----\nExact.'
    """
    if doc is None:  # Python runs without docstrings
        return None
    doc = inspect.cleandoc(doc)
    head = f"\n\n{_headed(title)}"
    if head in doc:
        before, _, after = doc.partition(head)
        after = after.removeprefix(f"{text.partition(chr(10))[0]}\n")
        return f"{before}{head}{text}\n\n{after}"
    places = (doc.find(f"\n\n{_headed(behind)}") for behind in _BEHIND[title])
    at = min((place for place in places if place >= 0), default=len(doc))
    return f"{doc[:at]}{head}{text}{doc[at:]}"


def _headed(title: str) -> str:
    return f"{title}\n{'-' * len(title)}\n"
