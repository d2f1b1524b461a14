"""Expressions of Python's syntax as instructions."""

from __future__ import annotations

import ast
import types
from collections.abc import Callable
from typing import Any

import numpy as np

from phasekit.numerics.compiler import arithmetic, arrays, functions
from phasekit.numerics.compiler.code import Code, constant
from phasekit.numerics.compiler.kinds import (
    BOOL,
    COMPLEX,
    FLOAT,
    INT,
    OBJECT,
    UNKNOWN,
    Array,
    CompileError,
    Tuple,
    Value,
    described,
    split,
    tuple_of,
)


def value(code: Code, node: ast.expr) -> Value:
    """The value of an expression."""
    translate = _NODES.get(type(node))
    if translate is None:
        raise CompileError(f"{type(node).__name__} is not supported")
    return translate(code, node)


def condition(code: Code, node: ast.expr) -> Value:
    """Whether an expression is true."""
    return arithmetic.truth(code, value(code, node))


def _constant(code: Code, node: Any) -> Value:
    return constant(node.value)


def _name(code: Code, node: Any) -> Value:
    name = node.id
    if name in code.source.local:
        if name not in code.variables:
            raise CompileError(f"{name!r} may be used before it has a value")
        return code.loaded(*code.variables[name])
    return _global(code, code.source.function.__globals__, name, code.source.looked_up(name))


def _global(code: Code, space: dict[str, Any], name: str, found: Any) -> Value:
    """What a global name stands for; the compiled code holds only as long as it does."""
    if isinstance(found, np.ndarray):
        code.program.depends(space, name, found)
        return code.program.constant_array(found)
    if isinstance(found, np.generic):
        found = found.item()
    if isinstance(found, (bool, int, float, complex, tuple, types.NoneType)):
        code.program.depends(space, name, found)
    return constant(found)


def _attribute(code: Code, node: Any) -> Value:
    owner = value(code, node.value)
    if owner.kind == OBJECT:
        found = getattr(owner.constant, node.attr, UNKNOWN)
        if found is UNKNOWN:
            raise CompileError(f"{ast.unparse(node)} is unknown")
        if isinstance(owner.constant, types.ModuleType):
            return _global(code, owner.constant.__dict__, node.attr, found)
        return constant(found)
    if isinstance(owner.kind, Tuple) and node.attr in owner.kind.names:
        place = owner.kind.names.index(node.attr)
        return split(owner.kind, owner.parts)[place]
    if isinstance(owner.kind, Array):
        if node.attr == "shape":
            return tuple_of(arrays.lengths(owner))
        if node.attr == "size":
            return arrays.size(code, owner)
        if node.attr == "ndim":
            return constant(owner.kind.ndim)
    if owner.kind == COMPLEX and node.attr in ("real", "imag"):
        return Value(FLOAT, (owner.parts[node.attr == "imag"],))
    if owner.kind == FLOAT and node.attr in ("real", "imag"):
        return owner if node.attr == "real" else constant(0.0)
    raise CompileError(f"{described(owner.kind)} has no {node.attr!r} here")


def indices(code: Code, node: ast.expr) -> list[Value | arrays.Slice]:
    """The indices and slices of a subscript."""
    found: list[Value | arrays.Slice] = []
    for part in node.elts if isinstance(node, ast.Tuple) else [node]:
        if isinstance(part, ast.Slice):
            if part.step is not None:
                raise CompileError("a slice has no step here")
            bounds = (None if b is None else value(code, b) for b in (part.lower, part.upper))
            first, last = bounds
            found.append((first, last))
        else:
            found.append(value(code, part))
    return found


def _subscript(code: Code, node: Any) -> Value:
    owner = value(code, node.value)
    if isinstance(owner.kind, Tuple):
        return _entry(code, owner, value(code, node.slice))
    if not isinstance(owner.kind, Array):
        raise CompileError(f"{described(owner.kind)} has no entries")
    found, address = arrays.view(code, owner, indices(code, node.slice))
    assert isinstance(found.kind, Array)
    return found if found.kind.ndim else arrays.load(code, found.kind.element, address)


def _entry(code: Code, owner: Value, index: Value) -> Value:
    """An entry of a tuple, at a place that the compiler need not know where all are alike."""
    assert isinstance(owner.kind, Tuple)
    values = split(owner.kind, owner.parts)
    if owner.constant is not UNKNOWN:
        values = [constant(one) for one in owner.constant]
    if index.constant is not UNKNOWN:
        return values[index.constant]
    kind = values[0].kind
    if any(one.kind != kind for one in values):
        raise CompileError("a tuple of unlike values wants an index that is written out")
    if owner.constant is not UNKNOWN and len(values) > 4 and kind in (FLOAT, INT):
        table = code.program.constant_array(
            np.array(owner.constant, "f8" if kind == FLOAT else "i8")
        )
        return arrays.load(code, table.kind.element, arrays.view(code, table, [index])[1])  # type: ignore[union-attr]
    if owner.constant is not UNKNOWN and isinstance(kind, Tuple) and set(kind.kinds) == {FLOAT}:
        table = code.program.constant_array(np.array(owner.constant))
        row = [arrays.view(code, table, [index, constant(i)])[1] for i in range(len(kind.kinds))]
        return tuple_of([arrays.load(code, table.kind.element, at) for at in row])  # type: ignore[union-attr]
    found = values[-1]
    for i, one in enumerate(values[:-1]):
        here = code.op(f"icmp eq i64 {index.parts[0]}, {i}")
        found = arithmetic.chosen(code, Value(BOOL, (here,)), one, found, kind)
    return found


def _tuple(code: Code, node: Any) -> Value:
    return tuple_of([value(code, one) for one in node.elts])


def _call(code: Code, node: Any) -> Value:
    if isinstance(node.func, ast.Attribute):
        owner = value(code, node.func.value)
        if owner.kind != OBJECT:
            return _method(code, owner, node.func.attr, [value(code, one) for one in node.args])
    function = value(code, node.func)
    if function.kind != OBJECT:
        raise CompileError(f"{ast.unparse(node.func)} is no function")
    args = [value(code, one) for one in node.args]
    named = {one.arg: value(code, one.value) for one in node.keywords}
    if functions.has_translation(function.constant):
        return functions.call(code, function.constant, [*args, *named.values()])
    return code.program.called(code, function.constant, args, named)


def _method(code: Code, owner: Value, name: str, args: list[Value]) -> Value:
    if name == "view" and len(args) == 1:
        return functions.view(code, owner, args[0])
    if name == "copy" and isinstance(owner.kind, Array):
        return arrays.copied(code, owner)
    if name == "conjugate" and owner.kind == COMPLEX:
        return Value(COMPLEX, (owner.parts[0], code.op(f"fneg double {owner.parts[1]}")))
    raise CompileError(f"{described(owner.kind)} has no method {name!r} here")


def _binary(code: Code, node: Any) -> Value:
    return arithmetic.binary(code, type(node.op), value(code, node.left), value(code, node.right))


def _unary(code: Code, node: Any) -> Value:
    if isinstance(node.op, ast.Not):
        return arithmetic.inverted(code, value(code, node.operand))
    operand = value(code, node.operand)
    if isinstance(node.op, ast.USub):
        return arithmetic.negative(code, operand)
    if isinstance(node.op, ast.UAdd):
        return operand
    raise CompileError("~ is not supported")


def _compare(code: Code, node: Any) -> Value:
    left = value(code, node.left)
    found: Value | None = None
    for operation, right_node in zip(node.ops, node.comparators, strict=True):
        right = value(code, right_node)
        here = arithmetic.compared(code, type(operation), left, right)
        found = here if found is None else _both(code, "and", found, here)
        left = right
    assert found is not None
    return found


def _both(code: Code, joint: str, left: Value, right: Value) -> Value:
    for one, other in ((left, right), (right, left)):
        if one.constant is not UNKNOWN:
            decides = bool(one.constant) == (joint == "or")
            return constant(bool(one.constant)) if decides else other
    return Value(BOOL, (code.op(f"{joint} i1 {left.parts[0]}, {right.parts[0]}"),))


def is_plain(node: ast.expr) -> bool:
    """Whether an expression may be worked out where its value is not asked for, at no cost."""
    return all(isinstance(part, _PLAIN) for part in ast.walk(node))


_PLAIN = (
    ast.Name, ast.Constant, ast.Compare, ast.BoolOp, ast.UnaryOp, ast.expr_context, ast.cmpop,
    ast.boolop, ast.unaryop, ast.Add, ast.Sub, ast.Mult, ast.BinOp,
)  # fmt: skip


def _bool(code: Code, node: Any) -> Value:
    """And, or: the operands after the first only where they decide."""
    joint = "and" if isinstance(node.op, ast.And) else "or"
    first, *others = node.values
    found = condition(code, first)
    for other in others:
        if found.constant is not UNKNOWN:
            if bool(found.constant) == (joint == "or"):
                return found
            found = condition(code, other)
        elif is_plain(other):
            found = _both(code, joint, found, condition(code, other))
        else:
            found = _lazy(code, joint, found, other)
    return found


def _lazy(code: Code, joint: str, found: Value, other: ast.expr) -> Value:
    slot = code.slot("i1")
    more, after = code.fresh("b"), code.fresh("b")
    code.do(f"store i1 {found.parts[0]}, ptr {slot}")
    code.branch(found.parts[0], *((more, after) if joint == "and" else (after, more)))
    code.block(more)
    code.do(f"store i1 {condition(code, other).parts[0]}, ptr {slot}")
    code.block(after)
    return Value(BOOL, (code.op(f"load i1, ptr {slot}"),))


def _choice(code: Code, node: Any) -> Value:
    """One value or another."""
    test = condition(code, node.test)
    if test.constant is not UNKNOWN:
        return value(code, node.body if test.constant else node.orelse)
    if is_plain(node.body) and is_plain(node.orelse):
        yes, no = value(code, node.body), value(code, node.orelse)
        return arithmetic.chosen(code, test, yes, no, code.joined("a value", yes.kind, no.kind))
    yes_label, no_label, after = (code.fresh("b") for _ in range(3))
    code.branch(test.parts[0], yes_label, no_label)
    code.block(yes_label)
    yes = value(code, node.body)
    yes_end = code.cut()
    code.block(no_label)
    no = value(code, node.orelse)
    kind = code.joined("a value", yes.kind, no.kind)
    slots = code.slots_of(kind)
    code.keep(slots, code.cast(no, kind))
    code.block(after)
    code.splice(yes_end, slots, yes, kind, after)
    return code.loaded(kind, slots)


_NODES: dict[type, Callable[[Code, Any], Value]] = {
    ast.Constant: _constant,
    ast.Name: _name,
    ast.Attribute: _attribute,
    ast.Subscript: _subscript,
    ast.Tuple: _tuple,
    ast.List: _tuple,
    ast.Call: _call,
    ast.BinOp: _binary,
    ast.UnaryOp: _unary,
    ast.Compare: _compare,
    ast.BoolOp: _bool,
    ast.IfExp: _choice,
}
