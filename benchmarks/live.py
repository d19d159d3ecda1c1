"""The live page: bytes, and frames while it plays; writes benchmarks/results/live.md. `--pictures DIR`: every preset.

`--readme` draws only docs/live.png and docs/live_own.png. `--minute DIR`: pictures of a visitor's minute, and of them
the animation docs/live_minute.webp.
"""

from __future__ import annotations

import argparse
import gzip
import math
import os
import statistics
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from io import BytesIO
from itertools import count, pairwise
from pathlib import Path
from typing import Any

from fracgyro.export.live import FACE, bundled, packed, write_page
from fracgyro.export.web import build_module
from machine import machine, write
from PIL import Image

MEASURES_CODE = True
DEPENDS_ON = ["integrations/web/**/*"]

ROOT = Path(__file__).resolve().parents[1]
PICTURE = ROOT / "docs/live.png"
OWN_PICTURE = ROOT / "docs/live_own.png"
MINUTE = ROOT / "docs/live_minute.webp"
ENDS = ("#plots", ".plot.timed")  # from the one to the other
CLOCK = "document.getElementById('clock').textContent"
LOOK = 1500  # ms from one picture of the visitor's minute to the next
SECONDS = 6
SPEED = 40  # units of time a second
FRAMES = f"""
new Promise((resolve) => {{
  const times = [];
  const clock = () => parseFloat(document.getElementById("clock").textContent.slice(4));
  const begin = clock();
  const next = (now) => {{
    times.push(now);
    if (now - times[0] < {1000 * SECONDS}) {{
      requestAnimationFrame(next);
    }} else {{
      resolve({{ times, units: clock() - begin }});
    }}
  }};
  requestAnimationFrame(next);
}})
"""
SETTINGS = {
    "two runs, the time of 20 units shown": "",
    "80 units shown": "&window=80",
    "two runs with the Kalman filter, from noisy positions": "&a=joint&b=lqg&sensors=positions",
    "one run": "&b=none",
    "the example of a function in the page as B": "&b=yours",
    "a drawn figure": "&figure=1+1,-1+1,-1+-1,1+-1",
}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--pictures", type=Path, metavar="DIR")
    parser.add_argument("--readme", action="store_true")
    parser.add_argument("--minute", type=Path, metavar="DIR")
    options = parser.parse_args()
    sys.path.insert(0, str(ROOT / "tests/python"))
    from browser import chromium, served

    with tempfile.TemporaryDirectory() as name, chromium() as browser:
        folder = Path(name)
        build_module(folder / "fracgyro.wasm")
        write_page(folder / "live", folder / "fracgyro.wasm")
        with served(folder / "live") as address:
            if options.pictures:
                draw_presets(browser, address, options.pictures)
            elif options.readme:
                draw(browser, address, PICTURE)
                draw_own(browser, address, OWN_PICTURE)
            elif options.minute:
                draw_minute(browser, address, options.minute)
            else:
                log(browser, address, folder)


def log(browser: Any, address: str, folder: Path) -> None:
    load, *_ = os.getloadavg()  # other work on the machine makes frames longer
    rows = [row(browser, address, what, hash) for what, hash in SETTINGS.items()]
    page = (folder / "live/index.html").read_bytes()
    parts = {
        "module, packed": len(packed((folder / "fracgyro.wasm").read_bytes())),
        "scripts of the page, packed": len(packed(bundled(FACE / "live/live.mjs").encode())),
        "scripts of the worker, packed": len(packed(bundled(FACE / "live/worker.mjs").encode())),
        "style": (FACE / "live/live.css").stat().st_size,
    }
    parts["text, and data of every law and gyroscope"] = len(page) - sum(parts.values())
    lines = [
        "# The live page",
        "",
        "Made by `python benchmarks/live.py`.",
        "",
        f"Machine: {machine('ziglang', 'playwright')}; "
        f"Chromium {browser.version}, headless, without a GPU, at 1280 × 800; load average {load:.1f} before.",
        "",
        f"Frames over {SECONDS} s, of the preset that the page begins with, playing {SPEED} units of time a second:",
        "",
        "| | median, ms | 95 %, ms | longest, ms | units simulated a second |",
        "|---|---|---|---|---|",
        *rows,
        "",
        "Bytes:",
        "",
        "| | bytes |",
        "|---|---|",
        *(f"| {what} | {count:,} |" for what, count in parts.items()),
        f"| **index.html**, all that is loaded | **{len(page):,}** |",
        f"| the same as a server compresses it | {len(gzip.compress(page, mtime=0)):,} |",
    ]
    write("live", lines)


def row(browser: Any, address: str, what: str, hash: str) -> str:
    with opened(browser, address, f"#follow&speed={SPEED}{hash}") as page:
        page.wait_for_timeout(2000)
        found = page.evaluate(FRAMES)
        times = found["times"]
        frames = [after - before for before, after in pairwise(times)]
        last = statistics.quantiles(frames, n=20)[-1]
        rate = found["units"] / (times[-1] - times[0]) * 1e3
        return f"| {what} | {statistics.median(frames):.1f} | {last:.1f} | {max(frames):.1f} | {rate:.1f} |"


@contextmanager
def opened(browser: Any, address: str, hash: str, **options: Any) -> Iterator[Any]:
    page = browser.new_page(**{"viewport": {"width": 1280, "height": 800}, **options})
    page.goto(address + hash)
    page.wait_for_function("document.getElementById('clock').textContent !== ''")
    yield page
    page.close()


def draw_presets(browser: Any, address: str, folder: Path) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    with opened(browser, address, "") as page:
        keys = page.evaluate("[...document.querySelectorAll('#presets a')].map((link) => link.hash)")
    for key in keys:
        for scheme in ("light", "dark"):
            for width in (360, 1280):
                options = {"color_scheme": scheme, "viewport": {"width": width, "height": 800}}
                with opened(browser, address, key, **options) as page:
                    page.wait_for_timeout(6000)
                    page.keyboard.press(" ")
                    page.screenshot(path=folder / f"{key[1:]}-{width}-{scheme}.png", full_page=True)


def draw(browser: Any, address: str, path: Path) -> None:
    """The first preset, with the rate reversed after 5 units of time, once."""
    options = {"viewport": {"width": 1100, "height": 1000}, "reduced_motion": "reduce"}
    with opened(browser, address, "#follow&speed=20", **options) as page:
        page.evaluate("document.getElementById('drawing').style.visibility = 'hidden'")  # its first line is cut
        page.click("#play")
        for until, act in ((5, "#rate-reverse"), (16, "#play")):
            page.wait_for_function(f"parseFloat({CLOCK}.slice(4)) >= {until}")
            page.click(act)
        settled(page)
        top, bottom = (page.evaluate(f"document.querySelector('{of}').getBoundingClientRect().top") for of in ENDS)
        save([page.screenshot(clip={"x": 0, "y": top - 8, "width": 1100, "height": bottom - top})], path)


def draw_own(browser: Any, address: str, path: Path) -> None:
    """A heart as the reference and, below, the function that follows it."""
    with opened(browser, address, "#draw&b=yours&speed=20", viewport={"width": 1100, "height": 2600}) as page:
        page.get_by_text("Draw the motion", exact=True).last.click()
        page.wait_for_function(f"parseFloat({CLOCK}.slice(4)) >= 22")
        page.click("#play")
        settled(page)
        shots = []
        for part in ("#bench", "#own"):
            box = page.locator(part).bounding_box()
            shots.append(page.screenshot(clip={"x": 0, "y": box["y"] - 8, "width": 1100, "height": box["height"] + 16}))
    save(shots, path)


def settled(page: Any) -> None:
    page.wait_for_function(f"{CLOCK}.includes('paused')")
    page.mouse.move(0, 0)
    page.wait_for_timeout(200)


def save(shots: list[bytes], path: Path) -> None:
    """One below the other."""
    parts = [Image.open(BytesIO(shot)).convert("RGB") for shot in shots]
    whole = Image.new("RGB", (parts[0].width, sum(part.height for part in parts)))
    top = 0
    for part in parts:
        whole.paste(part, (0, top))
        top += part.height
    whole.quantize(48).save(path, optimize=True)


def draw_minute(browser: Any, address: str, folder: Path) -> None:
    """Looks, turns, draws, writes a function, mistypes it and repairs it, looks at the spectrum."""
    folder.mkdir(parents=True, exist_ok=True)
    numbers = count()
    shots: list[Image.Image] = []

    def look(page: Any, times: int) -> None:
        for _ in range(times):
            page.wait_for_timeout(LOOK)
            shot = page.screenshot()
            (folder / f"{next(numbers):02}.png").write_bytes(shot)
            shots.append(Image.open(BytesIO(shot)).convert("RGB"))

    with opened(browser, address, "", viewport={"width": 1100, "height": 900}) as page:
        look(page, 5)
        page.fill("#rate", "-200")
        look(page, 4)
        page.click('a[href="#draw"]')
        page.get_by_text("Draw the motion", exact=True).last.click()
        page.evaluate("document.getElementById('sketch').scrollIntoView({ block: 'end' })")
        box = page.locator("#sketch").bounding_box()
        x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
        for i in range(61):
            angle = math.pi * i / 30.5
            radius = 60 + 20 * math.cos(3 * angle)
            page.mouse.move(x + radius * math.cos(angle), y - radius * math.sin(angle))
            if i == 0:
                page.mouse.down()
            elif i == 40:
                look(page, 1)
        page.mouse.up()
        look(page, 1)
        page.evaluate("scrollTo(0, 0)")
        look(page, 4)
        page.click('a[href="#your-own"]')
        look(page, 4)
        example = page.input_value("#code")
        for text in (example.replace("0.1 *", "0.01 *"), example.replace("s.velocity", "s.speed"), example):
            page.fill("#code", text)
            look(page, 1)
            page.focus("#code")
            page.keyboard.press("Control+Enter")
            look(page, 2)
            page.evaluate("scrollTo(0, 0)")
            look(page, 3)
        page.select_option("#plot", "spectrum")
        look(page, 4)
    first, *rest = (shot.resize((660, 540), Image.Resampling.LANCZOS) for shot in shots)
    first.save(MINUTE, save_all=True, append_images=rest, duration=LOOK // 2, quality=30, method=6)


if __name__ == "__main__":
    main()
