"""Chromium, driven: pages as they stand in it, with all that they asked for and complained of."""

import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import pytest
from playwright.sync_api import expect, sync_playwright

CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
PATIENCE_MS = 60_000

needs_chromium = pytest.mark.skipif(CHROMIUM is None, reason="no Chromium here")


@contextmanager
def launched() -> Iterator[Any]:
    """The browser, as long as it is needed."""
    # Chromium's sandbox does not start as root, as in a container.
    arguments = ["--no-sandbox"] if os.geteuid() == 0 else []
    expect.set_options(timeout=PATIENCE_MS)
    with sync_playwright() as playwright:
        chromium = playwright.chromium.launch(executable_path=CHROMIUM, args=arguments)
        yield chromium
        chromium.close()


class Opened:
    """A page in a browser, with all that it asked for and complained of."""

    def __init__(self, page: Any, address: str, path: str = "") -> None:
        self.page, self.address = page, address
        self.requests, self.complaints = list[str](), list[str]()
        page.set_default_timeout(PATIENCE_MS)
        page.on("request", lambda request: self.requests.append(request.url))
        page.on("console", lambda said: self.complaints.append(said.text))
        page.on("pageerror", lambda error: self.complaints.append(str(error)))
        page.goto(address + path)

    def is_clean(self) -> None:
        """Nobody else was asked, and nothing went wrong."""
        assert self.complaints == []
        others = [url for url in self.requests if not url.startswith((self.address, f"blob:{self.address}", "data:"))]
        assert others == []
