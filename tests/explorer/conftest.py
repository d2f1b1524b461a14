"""A browser for all tests of a module, if this machine has one."""

from __future__ import annotations

import pytest
from explorer.browser import Browser, installed

import phasekit as pk

BROWSER = installed()


@pytest.fixture(scope="module")
def browser():
    if BROWSER is None:
        pytest.skip(
            "no chromium on this machine (apt-get install chromium): the page of the explorer is "
            "not tried in a browser"
        )
    found = Browser(BROWSER)
    yield found
    found.close()


@pytest.fixture(scope="module")
def shown(browser, tmp_path_factory):
    """Open the page of a system; what it says and asks for is held against silence at the end."""
    folder = tmp_path_factory.mktemp("pages")

    def show(system, link="", **options) -> Browser:
        path = pk.explore(system).save(folder / f"{abs(hash(repr(system)))}.html")
        browser.open(f"{path.as_uri()}{link}", **options)
        return browser

    return show


@pytest.fixture
def silent(browser):
    """Hold the page to its silence: no message in the console, no request to anywhere."""
    yield
    assert browser.complaints() == []
    asked = browser.requests()
    assert asked
    assert all(url.startswith(("file:", "blob:", "data:", "about:")) for url in asked), asked
