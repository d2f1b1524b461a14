"""The statements of XPPAUT's files: lines joined, comments left out, arrays written out.

What each statement says of the equations is for `phasekit.systems.ode_problem`.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import NamedTuple, NoReturn

from phasekit.errors import ParameterError

#: Most statements that arrays may be written out to.
LONGEST = 20_000

#: Statements that begin with a word, by the letters that XPPAUT knows them by: what they are, or
#: why they cannot be read.
WORDS = {
    "done": "done", "d": "done",
    "only": "display", "set": "display", "b": "display", "options": "display",
    "special": "refused: sums over arrays by a table",
    "so": "refused: algebraic equations",
    "p": "par", "i": "init", "n": "number", "a": "aux", "w": "wiener",
    "g": "refused: a state that jumps at an event",
    "m": "refused: a Markov process",
    "t": "refused: a table of values",
    "v": "refused: an integral over the past",
    "e": "refused: code of a library",
}  # fmt: skip
_WORD = re.compile(r"([A-Za-z]+)(?:\s+(?![=(])(.*))?")
_NAME = r"([A-Za-z_]\w*)"
#: Statements that are equations.
EQUATIONS = (
    ("refused: an algebraic equation", re.compile(r"(0)\s*=(.*)")),
    ("rate", re.compile(rf"d{_NAME}\s*/\s*dt\s*=(.*)", re.IGNORECASE)),
    ("rate", re.compile(rf"{_NAME}\s*'\s*=(.*)")),
    ("step", re.compile(rf"{_NAME}\s*\(\s*t\s*\+\s*1\s*\)\s*=(.*)", re.IGNORECASE)),
    ("start", re.compile(rf"{_NAME}\s*\(\s*0\s*\)\s*=(.*)")),
    ("function", re.compile(rf"{_NAME}\s*\(([\w\s,]+)\)\s*=(.*)")),
    ("derived", re.compile(rf"!\s*{_NAME}\s*=(.*)")),
    ("fixed", re.compile(rf"{_NAME}\s*=(.*)")),
)
_SPAN = re.compile(r"\[\s*(-?\d+)\s*\.\.\s*(-?\d+)\s*\]")
_INDEX = re.compile(r"\[\s*(?:(\d+)\s*\*\s*)?(j|-?\d+)\s*(?:([-+*])\s*(\d+)\s*)?\]", re.IGNORECASE)


class Statement(NamedTuple):
    """A statement: where it stands, what it is, the name that it is about, and the rest."""

    where: str
    kind: str
    name: str
    text: str
    arguments: tuple[str, ...] = ()


def refuse(where: str, got: str, wants: str) -> NoReturn:
    """Refuse a statement."""
    got = got if len(got) <= 80 else f"{got[:60]}..."
    raise ParameterError(f"{where}: got {got}, wants {wants}")


def statements(text: str, name: str) -> Iterator[Statement]:
    """The statements of a file, in their order."""
    for number, line in written_out(text, name):
        where = f"{name}, line {number}"
        if line.startswith("@"):
            yield Statement(where, "options", "", line[1:])
            continue
        word = _WORD.fullmatch(line)
        kind = _kind(word[1].lower()) if word else None
        if word and kind and (word[2] or kind == "done"):
            if kind == "done":
                return
            if kind.startswith("refused"):
                refuse(
                    where, f"{line!r},{kind.removeprefix('refused:')}", "an ordinary flow or map"
                )
            yield Statement(where, kind, word[1], word[2])
            continue
        if re.search(r"\bint\s*[\[{]", line, re.IGNORECASE):
            refuse(where, f"{line!r}, an integral over the past", "an ordinary flow or map")
        for kind, pattern in EQUATIONS:
            if match := pattern.fullmatch(line):
                parts = [part.strip() for part in match.groups()]
                if kind.startswith("refused"):
                    refuse(
                        where, f"{line!r},{kind.removeprefix('refused:')}", "rates of all states"
                    )
                arguments = tuple(a.strip() for a in parts[1].split(",")) if len(parts) > 2 else ()
                yield Statement(where, kind, parts[0], parts[-1], arguments)
                break
        else:
            refuse(where, repr(line), "a statement of an .ode file, such as x'=y or par a=1")


def _kind(word: str) -> str | None:
    """What a word at the beginning of a line says."""
    for start, kind in WORDS.items():
        whole = start in ("done", "d", "only", "set", "options", "special")
        if word == start or (not whole and word.startswith(start)):
            return kind
    return None


def written_out(text: str, name: str) -> Iterator[tuple[int, str]]:
    """Lines with their numbers, joined where they go on, arrays written out."""
    block: list[tuple[int, str]] | None = None
    span: tuple[int, int] = (0, 0)
    count = 0
    for number, line in _joined(text):
        where = f"{name}, line {number}"
        if line.startswith("%"):
            if block is None:
                match = _SPAN.fullmatch(line[1:].strip())
                if match is None:
                    refuse(where, repr(line), "a range such as %[1..4]")
                span, block = (int(match[1]), int(match[2])), []
                continue
            lines = [
                (n, _indexed(one, j, f"{name}, line {n}")) for j in _range(span) for n, one in block
            ]
            block = None
        elif block is not None:
            block.append((number, line))
            continue
        elif match := _SPAN.search(line):
            own = int(match[1]), int(match[2])
            rest = line[: match.start()] + "[j]" + line[match.end() :]
            lines = [(number, _indexed(rest, j, where)) for j in _range(own)]
        else:
            lines = [(number, _indexed(line, None, where))]
        for pair in lines:
            count += 1
            if count > LONGEST:
                refuse(where, f"more than {LONGEST} statements", "a smaller system")
            yield pair
    if block is not None:
        refuse(f"{name}, line {block[-1][0] if block else number}", "its end", "% after %[..]")


def _range(span: tuple[int, int]) -> range:
    first, last = span
    return range(first, last + 1) if last >= first else range(first, last - 1, -1)


def _joined(text: str) -> Iterator[tuple[int, str]]:
    """Lines that say something, those that end with a backslash joined with the next."""
    begun, kept = 0, ""
    for number, line in enumerate(text.splitlines(), 1):
        line = line.strip()
        if not kept and line.startswith(("#", '"')):
            continue
        begun = begun if kept else number
        if line.endswith("\\"):
            kept += line[:-1] + " "
            continue
        if whole := (kept + line).strip():
            yield begun, whole
        kept = ""
    if kept.strip():
        yield begun, kept.strip()


def _indexed(line: str, j: int | None, where: str) -> str:
    """A line with the value of the index j, if it has one, in its brackets."""

    def value(match: re.Match[str]) -> str:
        times, index, sign, other = match.groups()
        if index in "jJ" and j is None:
            refuse(
                where, f"{match[0]} in {line!r}", "an index in a line of an array, such as x[1..4]"
            )
        found = j if j is not None and index in "jJ" else int(index)
        found *= int(times) if times else 1
        if sign:
            found = {"+": found + int(other), "-": found - int(other), "*": found * int(other)}[
                sign
            ]
        before = line[match.start() - 1 : match.start()]
        if found < 0 and (before.isalnum() or before == "_"):
            refuse(where, f"the index {found} in {line!r}", "one >= 0")
        return str(found) if found >= 0 else f"({found})"

    return _INDEX.sub(value, line)
