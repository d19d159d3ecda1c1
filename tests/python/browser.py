"""Pages in Debian's Chromium, served on this machine, with checks for forbidden behavior."""

from __future__ import annotations

import shutil
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from importlib.resources import files
from pathlib import Path
from typing import Any

CHROMIUM = shutil.which("chromium") or "/usr/bin/chromium"
# It does not look for updates, and needs neither a display nor its own sandbox.
FLAGS = [
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
]


@contextmanager
def chromium() -> Iterator[Any]:
    """Driven by Playwright."""
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        started = playwright.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
        try:
            yield started
        finally:
            started.close()


class Quiet(SimpleHTTPRequestHandler):
    def log_message(self, *words: Any) -> None:
        pass


@contextmanager
def served(folder: Path, handler: type[Quiet] = Quiet) -> Iterator[str]:
    server = ThreadingHTTPServer(("127.0.0.1", 0), partial(handler, directory=str(folder)))
    threading.Thread(target=server.serve_forever, daemon=True).start()
    try:
        yield f"http://127.0.0.1:{server.server_port}/"
    finally:
        server.shutdown()
        server.server_close()


def watched(page: Any, own: str) -> list[str]:
    """Fills with every message on the console, every error, and every request whose address does not begin with
    `own`."""
    faults: list[str] = []
    page.on("console", lambda message: faults.append(f"console: {message.text}"))
    page.on("pageerror", lambda error: faults.append(f"error: {error}"))
    within = (own, "data:", "blob:")
    page.on("request", lambda asked: None if asked.url.startswith(within) else faults.append(asked.url))
    return faults


def violations(page: Any, impacts: Sequence[str] = ("minor", "moderate", "serious", "critical")) -> list[str]:
    """Findings of axe-core."""
    page.evaluate(files("axe_playwright_python").joinpath("axe.min.js").read_text(encoding="utf-8"))
    found = page.evaluate("axe.run({ resultTypes: ['violations'] }).then(({ violations }) => violations)")
    chosen = (each for each in found if each["impact"] in impacts)
    return [f"{each['id']}: {node['html'][:160]}" for each in chosen for node in each["nodes"]]


def faults_of_report(browser: Any, path: Path) -> list[str]:
    """Serious findings of axe-core and a page wider than its window, on a telephone and a desk, light and dark."""
    faults = []
    for width in (400, 1280):
        for scheme in ("light", "dark"):
            with browser.new_page(viewport={"width": width, "height": 900}, color_scheme=scheme) as page:
                page.goto(path.as_uri())
                wide = page.evaluate("document.scrollingElement.scrollWidth")
                found = violations(page, ("serious", "critical")) + ([f"{wide} wide"] if wide > width else [])
                faults += [f"{width} {scheme}: {each}" for each in found]
    return faults
