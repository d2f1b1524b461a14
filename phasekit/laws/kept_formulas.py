"""Formulas as their text: SymPy reads it when something asks for more than is kept of it."""

from __future__ import annotations

import functools
import json
import weakref
from collections.abc import Callable, Sequence
from typing import Any

from phasekit.numerics.kept_answers import Answer, is_kept, kept_answer

#: Longest formulas, in letters, of which answers are kept.
LONG = 5000
#: Those in use, of which equal ones are one.
_SHARED: weakref.WeakValueDictionary[str, KeptFormulas] = weakref.WeakValueDictionary()


class KeptFormulas:
    """Formulas that SymPy has read once, in this process or another one, and found good."""

    def __init__(self, stated: Sequence[Any], read: Callable[[], tuple[Any, ...]]) -> None:
        self.stated, self._read = stated, read
        self._answers: dict[tuple[Any, ...], Answer] = {}
        self.answer(("read",), lambda: (len(self.expressions), ()))

    @functools.cached_property
    def expressions(self) -> tuple[Any, ...]:
        """SymPy's expressions."""
        return self._read()

    def answer(self, question: tuple[Any, ...], find: Callable[[], Answer]) -> Answer:
        """A plain value and machine code, kept or found; questions are texts and numbers."""
        found = self._answers.get(question)
        if found is None:
            found = self._answers[question] = kept_answer([self.stated, list(question)], find)
        return found


def kept_or_read(
    given: Sequence[Any], names: Sequence[Sequence[str]], shorthands: Sequence[Any],
    read: Callable[[], tuple[Any, ...]],
) -> KeptFormulas | tuple[Any, ...]:  # fmt: skip
    """Formulas in names, with what other names stand for; read at once where nothing is kept."""
    texts = [*given]
    for one in shorthands:
        if one is not None and type(one) is not dict:
            return read()
        texts += [part for pair in (one or {}).items() for part in pair]
    plain = all(type(text) is str for text in texts)
    if not plain or sum(map(len, texts)) > LONG or not is_kept():
        return read()
    stated = [list(given), [list(one) for one in names], list(shorthands)]
    key = json.dumps(stated)
    found = _SHARED.get(key)
    if found is None:
        found = _SHARED[key] = KeptFormulas(stated, read)
    return found


def read(formulas: Any) -> Any:
    """What a right-hand side is: SymPy's expressions of formulas, and a function as it is."""
    return formulas.expressions if isinstance(formulas, KeptFormulas) else formulas
