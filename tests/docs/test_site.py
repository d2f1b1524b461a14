"""The built site stands alone: no other host is asked for anything, and no link leads nowhere.

Build it first, and say where it is:

    sphinx-build -W docs site && PHASEKIT_SITE=site pytest tests/docs/test_site.py
"""

import os
import re
from functools import cache
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

import pytest

SITE = os.environ.get("PHASEKIT_SITE")
pytestmark = pytest.mark.skipif(
    SITE is None, reason="needs a built site: sphinx-build docs site, then PHASEKIT_SITE=site"
)

#: What a browser fetches without being asked to.
LOADED = {
    "audio": "src", "embed": "src", "iframe": "src", "img": "src", "input": "src",
    "object": "data", "script": "src", "source": "src", "track": "src", "video": "src",
}  # fmt: skip
FETCHING = {
    "stylesheet",
    "preload",
    "prefetch",
    "preconnect",
    "dns-prefetch",
    "icon",
    "modulepreload",
}
OUTSIDE = re.compile(r"^(?:https?:)?//", re.IGNORECASE)


class Page(HTMLParser):
    """What a page loads, links to, and can be linked to by."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.loads: list[str] = []
        self.links: list[str] = []
        self.anchors: set[str] = set()
        self.styles: list[str] = []
        self.in_style = False
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        given = dict(attrs)
        self.in_style = tag == "style"
        self.anchors |= {given[key] for key in ("id", "name") if given.get(key)}
        if tag in LOADED and given.get(LOADED[tag]):
            self.loads.append(given[LOADED[tag]])
        if given.get("srcset"):
            self.loads += [part.split()[0] for part in given["srcset"].split(",")]
        if tag == "link" and FETCHING & set((given.get("rel") or "").split()):
            self.loads.append(given["href"])
        if tag == "a" and given.get("href"):
            self.links.append(given["href"])
        if given.get("style"):
            self.styles.append(given["style"])

    def handle_data(self, data):
        if self.in_style:
            self.styles.append(data)

    def handle_endtag(self, tag):
        self.in_style = False


@cache
def page(path: Path) -> Page:
    return Page(path.read_text(encoding="utf-8"))


def pages() -> list[Path]:
    found = [p for p in sorted(Path(SITE).rglob("*.html")) if "_static" not in p.parts]
    assert len(found) > 60
    return found


def urls(css: str) -> list[str]:
    return [
        url.strip(" '\"")
        for pair in re.findall(r"url\(([^)]*)\)|@import\s+([^;]+);", css)
        for url in pair
        if url
    ]


def test_no_page_asks_another_host_for_anything():
    asked = {
        (str(path), url)
        for path in pages()
        for url in [*page(path).loads, *(u for css in page(path).styles for u in urls(css))]
        if OUTSIDE.match(url)
    }
    assert asked == set()


def test_no_style_sheet_asks_another_host():
    sheets = list(Path(SITE).rglob("*.css"))
    assert sheets
    asked = {
        (str(path), url)
        for path in sheets
        for url in urls(path.read_text(encoding="utf-8"))
        if OUTSIDE.match(url)
    }
    assert asked == set()


def test_formulas_are_set_by_what_the_site_holds():
    with_formulas = [p for p in pages() if 'class="math' in p.read_text(encoding="utf-8")]
    assert len(with_formulas) >= 5
    for path in with_formulas:
        scripts = [src for src in page(path).loads if "mathjax" in src]
        assert scripts, path
        for src in scripts:
            assert (path.parent / urlsplit(src).path).resolve().is_file(), (path, src)


def test_nothing_that_a_page_loads_is_missing():
    for path in pages():
        for url in page(path).loads:
            if OUTSIDE.match(url) or url.startswith("data:"):
                continue
            assert (path.parent / unquote(urlsplit(url).path)).resolve().is_file(), (path, url)


def test_no_link_inside_the_site_is_broken():
    broken = set()
    for path in pages():
        for url in page(path).links:
            parts = urlsplit(url)
            if parts.scheme or OUTSIDE.match(url):
                continue
            target = (path.parent / unquote(parts.path)).resolve() if parts.path else path
            if target.is_dir():
                target /= "index.html"
            if not target.is_file():
                broken.add((str(path), url))
            elif parts.fragment and target.suffix == ".html":
                if unquote(parts.fragment) not in page(target).anchors | {"top", ""}:
                    broken.add((str(path), url))
    assert broken == set()
