"""Statements of Python's syntax as instructions."""

from __future__ import annotations

import ast
import builtins
from collections.abc import Callable, Sequence
from typing import Any

from phasekit.numerics.compiler import arithmetic, arrays, expressions
from phasekit.numerics.compiler.code import Code, constant
from phasekit.numerics.compiler.kinds import (
    INT,
    NOTHING,
    UNKNOWN,
    Array,
    CompileError,
    Tuple,
    Value,
    described,
    split,
)
from phasekit.numerics.marks import lanes


def run(code: Code, nodes: Sequence[ast.stmt]) -> None:
    """Write statements, up to where a block of them ends."""
    for node in nodes:
        if not code.open:
            return
        translate = _NODES.get(type(node))
        try:
            if translate is None:
                raise CompileError(f"{type(node).__name__} is not supported")
            translate(code, node)
        except CompileError as error:
            if getattr(error, "line", None) is None:
                error.line = node.lineno  # type: ignore[attr-defined]
            raise


def _expression(code: Code, node: Any) -> None:
    if not isinstance(node.value, ast.Constant):  # a docstring
        expressions.value(code, node.value)


def _assign(code: Code, node: Any) -> None:
    value = expressions.value(code, node.value)
    for target in node.targets:
        _give(code, target, value)


def _annotated(code: Code, node: Any) -> None:
    if node.value is not None:
        _give(code, node.target, expressions.value(code, node.value))


def _give(code: Code, target: ast.expr, value: Value) -> None:
    if isinstance(target, ast.Name):
        code.assign(target.id, value)
    elif isinstance(target, ast.Tuple):
        if not isinstance(value.kind, Tuple) or len(value.kind.kinds) != len(target.elts):
            raise CompileError(f"{len(target.elts)} names for {described(value.kind)}")
        for one, part in zip(target.elts, split(value.kind, value.parts), strict=True):
            _give(code, one, part)
    elif isinstance(target, ast.Subscript):
        _store(code, expressions.value(code, target.value), _places(code, target), value)
    else:
        raise CompileError(f"{ast.unparse(target)} cannot be given a value here")


def _places(code: Code, target: ast.Subscript) -> list[Value | arrays.Slice]:
    return expressions.indices(code, target.slice)


def _store(code: Code, owner: Value, places: list[Value | arrays.Slice], value: Value) -> None:
    if not isinstance(owner.kind, Array):
        raise CompileError(f"an entry of {described(owner.kind)} is given a value")
    found, address = arrays.view(code, owner, places)
    assert isinstance(found.kind, Array)
    if found.kind.ndim:
        arrays.fill(code, found, value)
    else:
        arrays.store(code, found.kind.element, address, value)


def _augmented(code: Code, node: Any) -> None:
    target, operation = node.target, type(node.op)
    if isinstance(target, ast.Name):
        before = expressions.value(code, ast.Name(target.id, ast.Load()))
        if isinstance(before.kind, Array):
            raise CompileError(f"{target.id} is an array; write a loop")
        after = arithmetic.binary(code, operation, before, expressions.value(code, node.value))
        code.assign(target.id, after)
        return
    owner = expressions.value(code, target.value)
    if not isinstance(owner.kind, Array):
        raise CompileError(f"an entry of {described(owner.kind)} is given a value")
    found, address = arrays.view(code, owner, _places(code, target))
    assert isinstance(found.kind, Array)
    if found.kind.ndim:
        raise CompileError("an operation on a part of an array is not supported; write a loop")
    element = found.kind.element
    # Python takes the entry, works out the rest, and stores.
    before = arrays.load(code, element, address)
    after = arithmetic.binary(code, operation, before, expressions.value(code, node.value))
    arrays.store(code, element, address, after)


def _if(code: Code, node: Any) -> None:
    test = expressions.condition(code, node.test)
    if test.constant is not UNKNOWN:
        run(code, node.body if test.constant else node.orelse)
        return
    yes, no, after = (code.fresh("b") for _ in range(3))
    code.branch(test.parts[0], yes, no if node.orelse else after)
    code.block(yes)
    run(code, node.body)
    reached = code.open or not node.orelse
    code.jump(after)
    if node.orelse:
        code.block(no)
        run(code, node.orelse)
        reached = reached or code.open
        code.jump(after)
    if reached:
        code.block(after)


def _while(code: Code, node: Any) -> None:
    if node.orelse:
        raise CompileError("else of a while is not supported")
    head, inside, after = (code.fresh("b") for _ in range(3))
    code.block(head)
    test = expressions.condition(code, node.test)
    endless = test.constant is not UNKNOWN and bool(test.constant)
    if test.constant is not UNKNOWN and not endless:
        code.jump(after)
    elif endless:
        code.jump(inside)
    else:
        code.branch(test.parts[0], inside, after)
    code.block(inside)
    _looped(code, node, head, after)
    code.jump(head)
    if not endless or _breaks(node.body):
        code.block(after)


def _breaks(nodes: Sequence[ast.stmt]) -> bool:
    """Whether a loop has a break of its own."""
    for node in nodes:
        if isinstance(node, ast.Break):
            return True
        if not isinstance(node, (ast.For, ast.While)):
            parts = [getattr(node, name, []) for name in ("body", "orelse")]
            if any(isinstance(part, list) and _breaks(part) for part in parts):
                return True
    return False


def _looped(code: Code, node: Any, again: str, after: str) -> None:
    code.loops.append((again, after))
    run(code, node.body)
    code.loops.pop()


def _for(code: Code, node: Any) -> None:
    call = node.iter
    if isinstance(call, ast.Call) and not call.keywords:
        function = expressions.value(code, call.func)
        if function.constant is builtins.range or function.constant is lanes:
            bounds = [expressions.value(code, one) for one in call.args]
            _range(code, node, bounds, at_once=function.constant is lanes)
            return
    over = expressions.value(code, node.iter)
    if not isinstance(over.kind, Tuple):
        raise CompileError(f"a loop over {described(over.kind)}; wants range or a tuple")
    values = split(over.kind, over.parts)
    if over.constant is not UNKNOWN:
        values = [constant(one) for one in over.constant]
    after = code.fresh("b")
    for one in values:
        again = code.fresh("b")
        _give(code, node.target, one)
        _looped(code, node, again, after)
        code.block(again)
    run(code, node.orelse)
    code.block(after)


def _range(code: Code, node: Any, bounds: list[Value], *, at_once: bool) -> None:
    if any(bound.kind != INT for bound in bounds):
        raise CompileError("range wants whole numbers")
    start, stop, step = constant(0), bounds[0], constant(1)
    if len(bounds) > 1:
        start, stop = bounds[:2]
        step = bounds[2] if len(bounds) > 2 else step
    counter = code.slot("i64")
    head, inside, again, done, after = (code.fresh("b") for _ in range(5))
    code.do(f"store i64 {start.parts[0]}, ptr {counter}")
    code.block(head)
    i = code.op(f"load i64, ptr {counter}")
    code.branch(_ahead(code, i, stop, step), inside, done)
    code.block(inside)
    _give(code, node.target, Value(INT, (i,)))
    _looped(code, node, again, after)
    code.block(again)
    # It is below (or above) the end, so that the next one is no overflow.
    last = code.op(f"load i64, ptr {counter}")
    following = code.op(f"add nsw i64 {last}, {step.parts[0]}")
    code.do(f"store i64 {following}, ptr {counter}")
    code.jump(f"{head}, !llvm.loop {code.program.at_once()}" if at_once else head)
    code.block(done)  # without a break
    run(code, node.orelse)
    code.block(after)


def _ahead(code: Code, i: str, stop: Value, step: Value) -> str:
    """Whether a counter has not reached its end."""
    below = code.op(f"icmp slt i64 {i}, {stop.parts[0]}")
    if step.constant is not UNKNOWN and step.constant > 0:
        return below
    above = code.op(f"icmp sgt i64 {i}, {stop.parts[0]}")
    if step.constant is not UNKNOWN:
        return above
    up = code.op(f"icmp sgt i64 {step.parts[0]}, 0")
    return code.op(f"select i1 {up}, i1 {below}, i1 {above}")


def _break(code: Code, node: Any) -> None:
    code.jump(code.loops[-1][1])


def _continue(code: Code, node: Any) -> None:
    code.jump(code.loops[-1][0])


def _return(code: Code, node: Any) -> None:
    value = NOTHING if node.value is None else expressions.value(code, node.value)
    if isinstance(value.kind, Array) and not value.kind.whole:
        raise CompileError("a view with strides is returned")
    code.assign(RESULT, value)
    code.jump("exit")


def _pass(code: Code, node: Any) -> None:
    pass


#: The variable that holds what a function returns.
RESULT = "return"

_NODES: dict[type, Callable[[Code, Any], None]] = {
    ast.Expr: _expression,
    ast.Assign: _assign,
    ast.AnnAssign: _annotated,
    ast.AugAssign: _augmented,
    ast.If: _if,
    ast.While: _while,
    ast.For: _for,
    ast.Break: _break,
    ast.Continue: _continue,
    ast.Return: _return,
    ast.Pass: _pass,
}
