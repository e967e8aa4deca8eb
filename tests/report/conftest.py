"""The browser that pages are tested in: Debian's chromium, driven by playwright."""

from __future__ import annotations

import shutil
from contextlib import contextmanager

import pytest

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
QUIET = ("--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-background-networking",
         "--disable-component-update", "--disable-sync")  # fmt: skip


@pytest.fixture(scope="module")
def browser():
    if CHROMIUM is None:
        pytest.skip("no chromium: install one, on Debian `apt-get install chromium`")
    sync_api = pytest.importorskip("playwright.sync_api", reason="pip install 'irtscots-cl[test]'")
    with sync_api.sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=list(QUIET))
        yield browser
        browser.close()


@pytest.fixture(scope="module")
def opened(browser):
    """opened(file): a page of the browser once it is ready; `said` collects what it logs and asks other addresses."""

    @contextmanager
    def open_page(file):
        page = browser.new_page(viewport={"width": 1200, "height": 900})
        page.said = []
        page.on("console", lambda message: page.said.append(message.text))
        page.on("pageerror", lambda error: page.said.append(str(error)))
        page.on(
            "request", lambda request: page.said.append(request.url) if not request.url.startswith("file:") else None
        )
        page.goto(file.as_uri())
        page.wait_for_selector("html[data-ready=yes]")
        yield page
        page.close()

    return open_page
