"""Builds the WebAssembly module: `python faces/web/build.py DIR` leaves in DIR all that a page needs.

Nothing is linked in, neither a C nor a C++ library: what core/ and sim/ use of C++ is in its headers.
"""

from __future__ import annotations

import shutil
import sys
import tempfile
from pathlib import Path

from fracgyro.export.compilers import FLAGS, include, zig
from fracgyro.export.web import write_module_data

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
TARGET = ["-target", "wasm32-wasi"]


def build(folder: Path) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as scratch:
        compiled = Path(scratch) / "web.o"
        headers = include(ROOT / "core", ROOT / "sim")
        # 128-bit vectors are in every browser since 2023.
        zig("c++", *TARGET, *FLAGS, "-Os", "-msimd128", *headers, "-c", HERE / "web.cpp", "-o", compiled)
        link = ["-nostdlib", "-s", "-Wl,--no-entry", "-Wl,--export-dynamic", "-Wl,--export=__heap_base"]
        zig("cc", *TARGET, *link, compiled, "-o", folder / "fracgyro.wasm")
    write_module_data(folder / "fracgyro.json")
    for name in ("fracgyro.mjs", "fracgyro.d.ts"):
        shutil.copyfile(HERE / name, folder / name)


if __name__ == "__main__":
    build(Path(sys.argv[1]))
