"""What was found of formulas, kept on disk, so that SymPy need not be imported to find it again.

SymPy's import takes longer than most first answers. So a process that has not imported it looks
beside the kernels for what another one found of the same formulas: plain values and machine code.
Where that is not there, SymPy is imported and asked, and its answer is kept, as are some that
follow. What a process keeps that makes many formulas is bounded so; one that imported SymPy for
itself, and may have changed what it does, keeps nothing.

An answer holds for its question, the modules that find answers, SymPy, and what machine code
depends on.
"""

from __future__ import annotations

import base64
import functools
import importlib.util
import json
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from phasekit.numerics import kept

#: A plain value, and addresses of machine code.
Answer = tuple[Any, tuple[int, ...]]

#: What files of answers are called, and how many are kept.
NAME, MOST = "formulas", 2000
#: Answers that a process finds before it keeps no more.
AT_FIRST = 64
_found = 0
_PACKAGE = Path(__file__).parents[1]
#: Modules that find answers, beside the compiler.
FINDERS = (
    "arrays.py", "errors.py", "inputs.py", "laws/*.py", "numerics/*.py",
    "bifurcation/continuation/fields.py", "motion/rates.py", "motion/kernels/*.py",
    "systems/problem_parts.py",
)  # fmt: skip


def is_kept() -> bool:
    """Whether answers are read and kept: SymPy is of a release, and here only to find some."""
    sympy = sys.modules.get("sympy")
    if sympy is not None:
        ways = sympy.core.parameters.global_parameters
        if not (0 < _found < AT_FIRST and ways.evaluate and ways.distribute):
            return False
    return _algebra() is not None


def kept_answer(question: Sequence[Any], find: Callable[[], Answer]) -> Answer:
    """Answer a question about formulas from what is kept, or find the answer and keep it.

    A question is made of texts, numbers and lists of them.
    """
    from phasekit.numerics.compiler.machine import load, object_files

    global _found
    algebra = _algebra()
    form = json.dumps([question, algebra])
    content = kept.read(NAME, form)
    if content is not None:
        found = json.loads(content)
        images = map(base64.b85decode, found["code"])
        return found["value"], tuple(load(image, ("fill",))["fill"] for image in images)
    with object_files() as files:
        value, addresses = find()
    _found += 1
    if algebra is not None and all(address in files for address in addresses):
        code = [base64.b85encode(files[address]).decode() for address in addresses]
        content = json.dumps({"value": value, "code": code}).encode()
        kept.write(NAME, form, content, _sources(), {})
        kept.drop_oldest(NAME, MOST)
    return value, addresses


@functools.cache
def _sources() -> set[str]:
    """Files of the modules that find answers."""
    files = {str(path) for pattern in FINDERS for path in _PACKAGE.glob(pattern)}
    return files | set(_algebra() or ())


@functools.cache
def _algebra() -> tuple[str, ...] | None:
    """Files that say which releases of SymPy and mpmath these are; None of a version that is none.

    Versions under development change and are called the same.
    """
    files = []
    for package, file in (("sympy", "release.py"), ("mpmath", "__init__.py")):
        spec = importlib.util.find_spec(package)
        if spec is None or spec.origin is None:
            return None
        path = Path(spec.origin).with_name(file)
        try:
            text = path.read_text(encoding="utf-8")
        except OSError:
            return None
        line = next((one for one in text.splitlines() if one.startswith("__version__")), "dev")
        if "dev" in line:
            return None
        files.append(str(path))
    return tuple(files)
