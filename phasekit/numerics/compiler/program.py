"""A kernel and all that it calls, as one module in LLVM's language."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

from phasekit.numerics.compiler import statements
from phasekit.numerics.compiler.code import Code, Widened
from phasekit.numerics.compiler.expressions import value as expression_value
from phasekit.numerics.compiler.kinds import (
    NONE,
    NOTHING,
    UNKNOWN,
    CompileError,
    Kind,
    Value,
    tuple_of,
)
from phasekit.numerics.compiler.module import Module
from phasekit.numerics.compiler.source import definition
from phasekit.numerics.marks import mark_of


class Form(NamedTuple):
    """A function compiled for kinds of arguments: its name in the module, and what it returns."""

    symbol: str
    result: Kind


class Program(Module):
    """A module with its functions."""

    def __init__(self, *, checked: bool = False) -> None:
        super().__init__(checked=checked)
        self.forms: dict[tuple[Any, tuple[Kind, ...]], Form] = {}
        self.texts: list[str] = []
        self.sources: set[str] = set()
        self.writing: list[Any] = []

    def form(self, function: Callable[..., Any], kinds: tuple[Kind, ...], inlined: bool) -> Form:
        """A function compiled for kinds of arguments."""
        key = function, kinds
        if key not in self.forms:
            if function in self.writing:
                raise CompileError(f"{function.__qualname__} calls itself")
            self.writing.append(function)
            self.forms[key] = self._write(function, kinds, inlined)
            self.writing.pop()
        return self.forms[key]

    def _write(self, function: Callable[..., Any], kinds: tuple[Kind, ...], inlined: bool) -> Form:
        source = definition(function)
        self.sources.add(function.__code__.co_filename)
        declared: dict[str, Kind] = {}
        while True:
            code = Code(self, source, declared)
            try:
                self._body(code, kinds)
                break
            except Widened:
                continue
            except CompileError as error:
                raise _placed(error, source) from None
        symbol = f"{source.node.name}.{len(self.forms)}.{len(self.texts)}"
        result = (
            code.variables[statements.RESULT][0] if statements.RESULT in code.variables else NONE
        )
        self.texts.append(_function_text(code, symbol, kinds, result, inlined))
        return Form(symbol, result)

    def _body(self, code: Code, kinds: tuple[Kind, ...]) -> None:
        count = 0
        for name, kind in zip(code.source.parameters, kinds, strict=True):
            parts = tuple(f"%a{count + i}" for i in range(len(kind.types)))
            count += len(parts)
            code.assign(name, Value(kind, parts, None if kind == NONE else UNKNOWN))
        statements.run(code, code.source.node.body)
        if code.open:
            if statements.RESULT in code.variables:
                code.assign(statements.RESULT, NOTHING)
            code.jump("exit")

    def called(
        self, code: Code, function: Any, args: list[Value], named: dict[str | None, Value]
    ) -> Value:
        """What a function of ours gives."""
        names = getattr(function, "_fields", None)
        if names is not None and issubclass(function, tuple):
            return tuple_of([*args, *(named[name] for name in names[len(args) :])], names)
        mark = mark_of(function)
        if mark is None:
            name = getattr(function, "__qualname__", function)
            raise CompileError(
                f"{name} is no function that compiled code calls; mark it by `inline` or `routine`"
            )
        source = definition(mark.body)
        for name, default in source.defaults.items():
            if name not in named and source.parameters.index(name) >= len(args):
                named[name] = expression_value(code, default)
        values = [*args, *(named[name] for name in source.parameters[len(args) :] if name in named)]
        if len(values) != len(source.parameters):
            raise CompileError(
                f"{source.name} got {len(values)} arguments, wants {len(source.parameters)}"
            )
        if any(value.kind.types == () and value.kind != NONE for value in values):
            raise CompileError(f"{source.name} got a function or a type, wants numbers and arrays")
        form = self.form(mark.body, tuple(value.kind for value in values), mark.inlined)
        given = ", ".join(
            f"{kind} {part}"
            for value in values
            for kind, part in zip(value.kind.types, value.parts, strict=True)
        )
        types = form.result.types
        if not types:
            code.do(f"call void @{form.symbol}({given})")
            return Value(form.result, (), None if form.result == NONE else UNKNOWN)
        found = code.op(f"call {_returned(form.result)} @{form.symbol}({given})")
        if len(types) == 1:
            return Value(form.result, (found,))
        parts = (
            code.op(f"extractvalue {_returned(form.result)} {found}, {i}")
            for i in range(len(types))
        )
        return Value(form.result, tuple(parts))

    def text(self, *more: str) -> str:
        """The module."""
        return "\n".join([*self.declared.values(), *self.texts, *more, ""])


def _returned(kind: Kind) -> str:
    types = kind.types
    if not types:
        return "void"
    return types[0] if len(types) == 1 else f"{{{', '.join(types)}}}"


def _function_text(
    code: Code, symbol: str, kinds: tuple[Kind, ...], result: Kind, inlined: bool
) -> str:
    types = [one for kind in kinds for one in kind.types]
    parameters = ", ".join(f"{one} %a{i}" for i, one in enumerate(types))
    returned = _returned(result)
    attributes = "alwaysinline nounwind" if inlined else "nounwind"
    lines = [f"define internal {returned} @{symbol}({parameters}) {attributes} {{", *code.slots]
    if code.allocates:
        lines += ["  %arena = alloca ptr", "  store ptr null, ptr %arena"]
    lines += [*code.lines, "exit:"]
    if code.allocates:
        lines.append("  call void @release(ptr %arena)")
    if not result.types:
        lines.append("  ret void")
    else:
        slots = code.variables[statements.RESULT][1]
        for i, (one, slot) in enumerate(zip(result.types, slots, strict=True)):
            lines.append(f"  %r{i} = load {one}, ptr {slot}")
        if len(slots) == 1:
            lines.append(f"  ret {returned} %r0")
        else:
            so_far = "undef"
            for i, one in enumerate(result.types):
                lines.append(f"  %u{i} = insertvalue {returned} {so_far}, {one} %r{i}, {i}")
                so_far = f"%u{i}"
            lines.append(f"  ret {returned} {so_far}")
    return "\n".join([*lines, "}"])


def _placed(error: CompileError, source: Any) -> CompileError:
    """The error with the place in the source."""
    if getattr(error, "placed", False):
        return error
    line = getattr(error, "line", None) or source.node.lineno
    path = source.function.__code__.co_filename
    placed = CompileError(f"{path}:{line}: {source.name}: {error}")
    placed.placed = True  # type: ignore[attr-defined]
    return placed
