"""Generate the sample records in examples/records and the pictures of docs/record.md.

The gyroscope: N = 0.3 deg/sqrt(h), B = 4 deg/h, K = 12 deg/h/sqrt(h), 10 samples a second, four decimals.
"""

from __future__ import annotations

import math
import sys
import tempfile
from pathlib import Path

import numpy as np
from fracgyro.rate import analyze_record
from numpy.typing import NDArray

ROOT = Path(__file__).resolve().parents[1]
RECORDS, DOCS = ROOT / "examples" / "records", ROOT / "docs"
SAMPLES, INTERVAL = 18_000, 0.1
N, B, K = 0.3 / 60, 4 / 3600, 12 / 3600 / 60  # deg/s/sqrt(Hz), deg/s, deg/s/sqrt(s)
PICTURES = {"still": ("allan",), "warm_up": ("series", "allan"), "knock": ("series",)}

Array = NDArray[np.float64]


def noise(seed: int) -> Array:
    """deg/s"""
    rng = np.random.default_rng(seed)
    k = np.arange(1, 2 * SAMPLES)
    response = np.concatenate([[1.0], np.cumprod((k - 0.5) / k)])
    spectrum = np.fft.rfft(rng.normal(size=2 * SAMPLES), 4 * SAMPLES) * np.fft.rfft(response, 4 * SAMPLES)
    flicker = B * np.fft.irfft(spectrum)[SAMPLES : 2 * SAMPLES]
    walk = K * math.sqrt(INTERVAL) * np.cumsum(rng.normal(size=SAMPLES))
    return np.asarray(N / math.sqrt(INTERVAL) * rng.normal(size=SAMPLES) + flicker + walk)


def records() -> dict[str, Array]:
    """deg/s"""
    time = INTERVAL * np.arange(SAMPLES)
    knock = noise(3)
    at = np.arange(12)
    knock[6000:6012] += 4.0 * np.exp(-at / 4) * np.cos(2 * at)
    return {"still": noise(1), "warm_up": noise(2) + 0.06 * np.exp(-time / 200), "knock": knock}


def main(docs: Path = DOCS, folder: Path = RECORDS) -> None:
    for name, values in records().items():
        rows = (f"{INTERVAL * i:.1f},{value:.4f}\n" for i, value in enumerate(values))
        (folder / f"{name}.csv").write_text("time [s],rate [deg/s]\n" + "".join(rows), encoding="utf-8", newline="\n")
        with tempfile.TemporaryDirectory() as scratch:
            analyze_record(folder / f"{name}.csv", Path(scratch) / "out")
            for picture in PICTURES[name]:
                text = (Path(scratch) / "out" / f"{picture}.svg").read_text(encoding="utf-8")
                (docs / f"record_{name}_{picture}.svg").write_text(text, encoding="utf-8", newline="\n")


if __name__ == "__main__":
    main(*map(Path, sys.argv[1:]))
