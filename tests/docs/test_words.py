"""README and pages are in plain English: short sentences, no turns that make them hard to read."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
PAGES = [page for page in PAGES if "_build" not in page.parts and "generated" not in page.parts]
LONGEST = 35

#: Turns of phrase that read as if they were translated.
TURNED = (
    r"\bwhat (?:phasekit|it|rounding) makes of\b",
    r"\bof which no\b",
    r"\bheld back\b",
    r"\bholds back\b",
    r"\blooked at by hand\b",
    r"\bwith which a system\b",
    r"\bmakes a page\b",
    r"\bwhat takes longest\b",
    r"\bis left out of it\b",
    r"\bas far as [\w,]+ steps go\b",
    r"\bthat turns the curve\b",
    r"\bcan be had\b",
    r"\bcould be had\b",
    r"\bis said in\b",
    r"\bpassed unseen\b",
    r"\bOf the others\b",
    r"\bSo have\b",
    r"\bSo has\b",
    r"\bas a reader types\b",
    r"\bis no system of\b",
    r"\bno quantities? of its\b",
    r"\bare told apart by\b",
    r"\bof one's own\b",
    r"\bsays? what is so\b",
    r"\bin place of that\b",
    r"\bhas not\b(?! been)",
    r"\bhave not\b(?! been)",
)


def prose(page: str) -> list[str]:
    """The sentences of a page: no code, formulas, tables, headings, comments or directives."""
    page = re.sub(r"\A---\n.*?\n---\n", "", page, flags=re.DOTALL)
    page = re.sub(r"^(`{3,}|:{3,}).*?^\1", "", page, flags=re.DOTALL | re.MULTILINE)
    page = re.sub(r"\$\$.*?\$\$|<!--.*?-->", "", page, flags=re.DOTALL)
    page = re.sub(r"(?m)^(?:[|#>%]|:::|\+\+\+).*$", "", page)
    page = re.sub(r"!\[[^\]]*\]\([^)]*\)", "", page)
    page = re.sub(r"\$[^$]*\$", "x", page)
    found = []
    for block in re.split(r"\n\s*\n|\n(?=\s*(?:[-*]|\d+\.|:) )", page):
        found += re.split(r"(?<=[.!?:;])\s+", " ".join(block.split()))
    return [sentence for sentence in found if sentence]


def test_sentences_are_found():
    found = prose(
        "# No\n\nOne two, $a + b$.\nThree: four\n\n```python\nno = 1\n```\n- five\n| no |\n"
    )
    assert found == ["One two, x.", "Three:", "four", "- five"]
    assert len(PAGES) > 20
    assert sum(len(prose(page.read_text(encoding="utf-8"))) for page in PAGES) > 1000


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_sentences_are_short(page):
    sentences = prose(page.read_text(encoding="utf-8"))
    long = [text for text in sentences if len(text.split()) > LONGEST]
    assert not long, "\n".join(long)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_nothing_is_turned(page):
    text = " ".join(prose(page.read_text(encoding="utf-8")))
    turned = [found.group() for turn in TURNED for found in re.finditer(turn, text)]
    assert not turned
