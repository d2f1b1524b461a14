"""Formulas of states as quantities: their least, greatest and mean values, ``max(x*y)``."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from typing import Any

from phasekit.laws.equations import Equations
from phasekit.systems.problem_parts import expressions_of
from phasekit.table.equations import EXTREMA

_CALL = re.compile(rf"({'|'.join(EXTREMA)})(\(.*\))(_error)?", re.DOTALL)


def split_extreme(text: str) -> tuple[str, str] | None:
    """The part of a function that is asked for, and its formula in parentheses; None of others.

    >>> split_extreme("max(x*y)"), split_extreme("max_x"), split_extreme("max(x) + max(y)")
    (('max', '(x*y)'), None, None)
    >>> split_extreme("max(x, y)") is None  # the greater one of two
    True
    """
    if (found := _CALL.fullmatch(text)) is None:
        return None
    part, formula, _ = found.groups()
    depth = 0
    for k, sign in enumerate(formula):
        depth += (sign == "(") - (sign == ")")
        if (depth == 0 and k < len(formula) - 1) or (depth == 1 and sign == ","):
            return None
    return part, formula


def asked_formulas(
    of: Any, law: Equations, observables: Mapping[str, Any] | None = None
) -> dict[str, Any]:
    """The formulas along motions that are asked for, in parentheses, as sympy expressions.

    They are of the states, the parameters, the time, and observables by their names.
    """
    names = (of,) if isinstance(of, str) else of if isinstance(of, Iterable) else ()
    parts = (split_extreme(name) for name in names if isinstance(name, str))
    keys = list(dict.fromkeys(one[1] for one in parts if one is not None))
    if not keys:
        return {}
    clock = () if law.time is None else (law.time,)
    texts, known = [key[1:-1] for key in keys], [*law.states, *law.names, *clock]
    found = expressions_of(texts, known, "of", law.states, dict(observables or {}))
    return dict(zip(keys, found, strict=True))
