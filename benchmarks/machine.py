"""What a measurement was made on."""

import platform
import subprocess
from pathlib import Path

import numpy as np


def machine() -> str:
    """Processor, system, and the versions that matter, in one line."""
    info = Path("/proc/cpuinfo")
    names = [line.partition(":")[2].strip() for line in info.read_text().splitlines() if line.startswith("model name")]
    processor = f"{len(names)} × {names[0]}" if names else platform.processor()
    compiler = subprocess.run(["c++", "--version"], capture_output=True, text=True, check=True).stdout.splitlines()[0]
    return (
        f"{processor}, {platform.system()} {platform.machine()}; Python {platform.python_version()}, "
        f"NumPy {np.__version__}; {compiler}"
    )


def write(name: str, lines: list[str]) -> None:
    """Prints the log and keeps it as benchmarks/results/<name>.md."""
    text = "\n".join(lines) + "\n"
    (Path(__file__).parent / "results" / f"{name}.md").write_text(text, encoding="utf-8")
    print(text)
