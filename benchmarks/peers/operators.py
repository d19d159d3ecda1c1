"""Fractional operators of other libraries, each as a function from a record to the Caputo derivative at its samples."""

import ctypes
import math
import subprocess
from collections.abc import Callable
from pathlib import Path

import fracmem
import numpy as np
from differint import differint
from fracmem.embedded import export_c
from pycaputo.differentiation import diff
from pycaputo.differentiation.caputo import L1, BirkSong
from pycaputo.grid import make_uniform_points
from scipy.fft import irfft, next_fast_len, rfft

Signal = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]  # times to values and rates


def fft_l1(values: np.ndarray, step: float, order: float) -> np.ndarray:
    """L1: the signal linear between samples, the true kernel; one convolution by SciPy's FFT."""
    count = len(values) - 1
    grown = np.arange(count + 1) ** (1.0 - order)
    length = next_fast_len(2 * count, real=True)
    spectrum = rfft(np.diff(grown), length) * rfft(np.diff(values), length)
    return np.concatenate([[0.0], irfft(spectrum, length)[:count]]) * step**-order / math.gamma(2.0 - order)


def pycaputo_l1(values: np.ndarray, step: float, order: float) -> np.ndarray:
    points = make_uniform_points(len(values), a=0.0, b=(len(values) - 1) * step)
    return diff(L1(order), values, points)


def pycaputo_birk_song(signal: Signal, count: int, step: float, order: float, nodes: int) -> np.ndarray:
    """Diffusive representation: it takes the rate as a function of time, and an ODE solver for its equations."""
    points = make_uniform_points(count, a=0.0, b=(count - 1) * step)

    def function(t: np.ndarray, d: int = 0) -> np.ndarray:
        return signal(np.asarray(t))[d]

    return diff(BirkSong(order, method="LSODA", quad_order=nodes), function, points)


def differint_gl(values: np.ndarray, step: float, order: float) -> np.ndarray:
    return differint.GL(order, values - values[0], 0.0, (len(values) - 1) * step, len(values))


def differint_rl(values: np.ndarray, step: float, order: float) -> np.ndarray:
    return differint.RL(order, values - values[0], 0.0, (len(values) - 1) * step, len(values))


def fracmem_c(folder: Path, step: float, order: float, longest: int) -> Callable[[np.ndarray], np.ndarray]:
    """fracmem's filter for microcontrollers, L = 32, p = 16, fitted to sums of sines, exported and compiled."""
    generator = np.random.default_rng(0)
    times = step * np.arange(longest // 4)
    sines = generator.uniform([-1.0, 0.3, 0.0], [1.0, 5.0, 6.3], (4, 4, 3))  # four records of four: factor, ω, phase
    training = [sum(a * np.sin(w * times + p) for a, w, p in record) for record in sines]
    fitted = fracmem.CompressedFractionalFilter(order, step, L=32, p=16, definition="caputo").fit(
        training, j_max=longest
    )
    sources = Path(fracmem.__file__).parent / "embedded" / "c"
    export_c(fitted, str(folder / "filter.c"))
    (folder / "apply.c").write_text(
        '#include "fracmemfilter.h"\n'
        "extern FracmemFilter filt;\n"
        "void filtSetup(void);\n"
        "void apply(const float *x, float *y, long n) {\n"
        "    filtSetup();\n"
        "    for (long i = 0; i < n; ++i) y[i] = fracmemStep(&filt, x[i]);\n"
        "}\n"
    )
    parts = [folder / "filter.c", folder / "apply.c", sources / "fracmemfilter.c"]
    options = ["-O3", "-march=native", "-shared", "-fPIC", "-I", sources, "-o", folder / "filter.so"]
    subprocess.run(["cc", *map(str, options), *map(str, parts)], check=True)
    library = ctypes.CDLL(str(folder / "filter.so"))

    def apply(values: np.ndarray) -> np.ndarray:
        single = values.astype(np.float32)
        result = np.empty_like(single)
        library.apply(
            single.ctypes.data_as(ctypes.c_void_p), result.ctypes.data_as(ctypes.c_void_p), ctypes.c_long(len(single))
        )
        return result

    return apply
