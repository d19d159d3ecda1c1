"""What compiling for other processors needs, and what happens to tests where it is missing."""

from __future__ import annotations

import os
import shutil

import pytest
from fracgyro.export import compilers

# What a face needs.
TOOLS = {
    "Cortex-M": ("arm-none-eabi-g++", "qemu-system-arm"),
    "clang": ("clang", "clang++"),
    "WebAssembly": ("node", "zig"),
}


def need(face: str) -> None:
    """Skips the test where a tool is missing, unless nothing may be skipped."""
    found = {tool: compilers.has_zig() if tool == "zig" else shutil.which(tool) for tool in TOOLS.get(face, ())}
    missing = [tool for tool, there in found.items() if not there]
    if missing:
        reason = f"face {face}: {', '.join(missing)} missing, which `make setup-embedded` installs"
        if os.environ.get("FRACGYRO_SKIP_NOTHING"):
            pytest.fail(reason)
        pytest.skip(reason)
