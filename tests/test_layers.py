"""Who may know whom: what import-linter cannot see, modules that are named in strings."""

from __future__ import annotations

import ast
import functools
import re
import tomllib
from collections.abc import Collection
from pathlib import Path

import phasekit
from phasekit.systems.registry import models

ROOT = Path(phasekit.__file__).parent
MODULE = re.compile(r"(phasekit(?:\.[a-z_]\w*)+)(?::\w*)?")
#: The one stair up: results draw themselves.
STAIRS = {("phasekit.labelled.pictures", "phasekit.plot")}
#: The package's own table of public names.
ROOF = "phasekit.__init__"


@functools.cache
def modules() -> dict[str, list[ast.AST]]:
    """All nodes of the tree of each module, parsed once for all tests."""
    return {
        ".".join(("phasekit", *path.relative_to(ROOT).with_suffix("").parts)): list(
            ast.walk(ast.parse(path.read_text()))
        )
        for path in ROOT.rglob("*.py")
    }


def known(name: str, all_modules: Collection[str]) -> str | None:
    """The module that a dotted name is, or is in."""
    while name:
        for found in (name, f"{name}.__init__"):
            if found in all_modules:
                return found
        name = name.rpartition(".")[0]
    return None


@functools.cache
def named(module: str) -> tuple[set[str], set[str]]:
    """Modules that a module imports, wherever in it; and those that it names in strings."""
    all_modules = modules()
    tree = all_modules[module]
    texts = {
        id(node.body[0].value)
        for node in tree
        if isinstance(node, (ast.Module, ast.ClassDef, ast.FunctionDef))
        and node.body
        and isinstance(node.body[0], ast.Expr)
    }
    imported, quoted = set(), set()
    for node in tree:
        if isinstance(node, ast.ImportFrom) and node.module:
            for alias in node.names:
                found = known(f"{node.module}.{alias.name}", all_modules)
                imported.add(found)
        elif isinstance(node, ast.Import):
            imported.update(known(alias.name, all_modules) for alias in node.names)
        elif isinstance(node, ast.Constant) and isinstance(node.value, str):
            match = MODULE.fullmatch(node.value.rstrip("."))
            if match and id(node) not in texts:
                quoted.add(known(match.group(1), all_modules))
    return imported - {None, "phasekit.__init__"}, quoted - {None, "phasekit.__init__"}


def floors() -> dict[str, int]:
    """Floor of each top name, the lowest 0, as pyproject.toml has it."""
    config = tomllib.loads((ROOT.parent / "pyproject.toml").read_text())
    contracts = config["tool"]["importlinter"]["contracts"]
    (layers,) = (c["layers"] for c in contracts if c["type"] == "layers")
    return {
        name.strip(): height
        for height, row in enumerate(reversed(layers))
        for name in row.split("|")
    }


def floor_of(module: str, heights: dict[str, int]) -> int:
    return next(h for name, h in heights.items() if f"{module}.".startswith(f"{name}."))


def test_modules_named_in_strings_obey_the_floors():
    heights = floors()
    seen = 0
    for module in modules():
        if module == ROOF:
            continue
        for target in named(module)[1]:
            seen += 1
            if (module, target.removesuffix(".__init__")) in STAIRS:
                continue
            assert floor_of(target, heights) <= floor_of(module, heights), (module, target)
    assert seen > 10


def test_no_module_is_on_no_floor():
    heights = floors()
    for module in modules():
        if module != ROOF:
            assert floor_of(module, heights) >= 0, module


def test_there_is_no_import_circle():
    """Imports for types and inside functions count, and so do modules that strings name."""
    arrows = {
        module: {
            target
            for target in set().union(*named(module))
            if (module, target.removesuffix(".__init__")) not in STAIRS
        }
        for module in modules()
        if module != ROOF
    }
    circles = [c for c in strongly_connected(arrows) if len(c) > 1]
    assert circles == []


def test_nothing_knows_a_system_by_the_name_of_its_class():
    """A method belongs to a rung of the ladder of laws; what a system adds, its class says."""
    names, seen = set(models()), 0
    for module, tree in modules().items():
        for node in tree:
            parts = []
            if isinstance(node, ast.Dict):
                parts = node.keys
            elif isinstance(node, ast.Compare):
                parts = [node.left, *node.comparators]
            seen += len(parts)
            known = {part.value for part in parts if isinstance(part, ast.Constant)} & names
            assert not known, (module, node.lineno)
    assert len(names) > 8
    assert seen > 1000


def test_no_function_asks_which_particular_system_it_got():
    """What a function does follows from the rung of a law and from what is given."""
    homes = {model.__module__ for model in models().values()}  # a system knows its own parts
    names, seen = set(models()), 0
    for module, tree in modules().items():
        if module in homes:
            continue
        for node in tree:
            if not isinstance(node, ast.Call) or not isinstance(node.func, ast.Name):
                continue
            if node.func.id in ("isinstance", "issubclass") and len(node.args) == 2:
                seen += 1
                asked = {n.id for n in ast.walk(node.args[1]) if isinstance(n, ast.Name)}
                asked |= {n.attr for n in ast.walk(node.args[1]) if isinstance(n, ast.Attribute)}
                assert not asked & names, (module, node.lineno)
    assert len(names) > 8
    assert seen > 100


def test_no_room_is_too_big():
    """Lines of a room of the package, as a share of all."""
    lines: dict[str, int] = {}
    for path in ROOT.rglob("*.py"):
        room = path.relative_to(ROOT).parts[0]
        lines[room] = lines.get(room, 0) + len(path.read_bytes().splitlines())
    top = max(lines, key=lines.__getitem__)
    assert lines[top] <= 0.15 * sum(lines.values()), (top, lines[top], sum(lines.values()))


def strongly_connected(arrows: dict[str, set[str]]) -> list[set[str]]:
    """Sets of nodes that reach each other."""
    reach: dict[str, set[str]] = {}
    for start in arrows:
        seen: set[str] = set()
        stack = [start]
        while stack:
            for target in arrows.get(stack.pop(), ()):
                if target not in seen:
                    seen.add(target)
                    stack.append(target)
        reach[start] = seen
    found: list[set[str]] = []
    for node in arrows:
        circle = {other for other in reach[node] if node in reach.get(other, ())} | {node}
        if circle not in found:
            found.append(circle)
    return found
