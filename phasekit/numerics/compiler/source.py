"""The source of a function: its syntax tree, and what its global names stand for."""

from __future__ import annotations

import ast
import builtins
import functools
import os
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from phasekit.numerics.compiler.kinds import CompileError


@dataclass(frozen=True, eq=False)
class Definition:
    """A function as it is written."""

    function: Callable[..., Any]
    node: ast.FunctionDef
    parameters: tuple[str, ...]
    defaults: dict[str, ast.expr]
    local: frozenset[str]
    """Names that are assigned in it."""

    @property
    def name(self) -> str:
        """Where it stands, for messages."""
        return f"{self.function.__module__}.{self.node.name}"

    def looked_up(self, name: str) -> Any:
        """What a global name stands for."""
        space = self.function.__globals__
        if name in space:
            return space[name]
        if hasattr(builtins, name):
            return getattr(builtins, name)
        raise CompileError(f"the name {name!r} is unknown")


@functools.cache
def definition(function: Callable[..., Any]) -> Definition:
    """The source of a function."""
    code: Any = getattr(function, "__code__", None)
    if code is None:
        raise CompileError(f"{function!r} is no function whose source can be read")
    if code.co_freevars:
        raise CompileError(f"{function.__qualname__} uses names of the function round it")
    path = code.co_filename
    node = _functions(path, stamp(path)).get((code.co_name, code.co_firstlineno))
    if node is None:
        raise CompileError(f"the source of {function.__qualname__} is not in {code.co_filename}")
    arguments = node.args
    if arguments.vararg or arguments.kwarg or arguments.kwonlyargs:
        raise CompileError(f"{function.__qualname__} has other than plain parameters")
    parameters = tuple(a.arg for a in (*arguments.posonlyargs, *arguments.args))
    assigned = (
        n.id for n in ast.walk(node) if isinstance(n, ast.Name) and isinstance(n.ctx, ast.Store)
    )
    defaults = dict(zip(reversed(parameters), reversed(arguments.defaults), strict=False))
    return Definition(function, node, parameters, defaults, frozenset((*parameters, *assigned)))


def stamp(path: str) -> tuple[int, int]:
    """What changes when a file is written anew."""
    try:
        found = os.stat(path)
    except OSError:
        return 0, 0
    return found.st_mtime_ns, found.st_size


@functools.lru_cache(maxsize=256)
def _functions(path: str, written: tuple[int, int]) -> dict[tuple[str, int], ast.FunctionDef]:
    """All functions of a file, by name and by the line where their first decorator stands."""
    try:
        with open(path, encoding="utf-8") as file:
            tree = ast.parse(file.read())
    except OSError as error:
        raise CompileError(f"the source {path} cannot be read: {error}") from None
    found = {}
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef):
            line = min((node.lineno, *(d.lineno for d in node.decorator_list)))
            found[node.name, line] = node
    return found
