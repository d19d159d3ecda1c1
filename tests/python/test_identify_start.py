"""The start of an identification: few bins of a long record, and least squares that lose no digits."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest
from bench_records import DUAL_MASS
from fracgyro.identification import first_stage
from fracgyro.identification.model import Shape
from fracgyro.identification.records import of_arrays
from fracgyro.identification.spectra import Spectrum, spectrum
from fracgyro.identification.start import least_squares, linear_start


def test_least_squares_are_those_of_numpy() -> None:
    generator = np.random.default_rng(0)
    matrix = generator.normal(size=(300, 6)) * 10.0 ** np.arange(-6, 6, 2)
    target = generator.normal(size=300)
    scaled = np.linalg.lstsq(matrix / np.linalg.norm(matrix, axis=0), target, rcond=None)[0]
    np.testing.assert_allclose(least_squares(matrix, target), scaled / np.linalg.norm(matrix, axis=0), rtol=1e-12)


def test_a_thinned_spectrum_keeps_the_peaks_and_the_width_of_the_band() -> None:
    whole = spectrum(DUAL_MASS.motion(20_000, 12.6), None, DUAL_MASS.interval(12.6)).between(2e4, 3e4)
    few = whole.thinned(200)
    assert 150 < len(few.frequency) <= 200
    assert few.frequency[0] == whole.frequency[0]
    assert few.frequency[-1] == whole.frequency[-1]
    assert (np.diff(few.frequency) > 0).all()
    for i in range(2):
        assert np.abs(few.motion[:, i]).max() == np.abs(whole.motion[:, i]).max()
    assert whole.thinned(10**6) is whole


def test_a_long_record_starts_from_few_bins(monkeypatch: pytest.MonkeyPatch) -> None:
    """The first band of a long record is wide: without thinning the start costs more than all the rest."""
    counts: list[int] = []

    def counted(shape: Shape, spectra: Sequence[Spectrum], unit: float) -> np.ndarray:
        counts.extend(len(each.frequency) for each in spectra)
        return linear_start(shape, spectra, unit)

    monkeypatch.setattr(first_stage, "linear_start", counted)
    segment = of_arrays(DUAL_MASS.record(200_000))
    whole = spectrum(segment.motion, None, segment.interval)
    found = first_stage.fit_segments([segment])
    assert len(whole.frequency) > 50_000
    assert max(counts) <= first_stage.MAX_START_BINS
    turn = found.unit / DUAL_MASS.omega
    scale = np.array([turn**2] * 4 + [turn] * 4)
    error = (found.fit.parameters * scale - DUAL_MASS.parameters) / np.sqrt(np.diag(found.fit.covariance)) / scale
    assert np.abs(error).max() < 4.0
