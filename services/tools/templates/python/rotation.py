"""A search for the rotation between two scans: their spectra turn as they do, and a translation leaves them as they are."""

import numpy as np

BEARINGS = 1440


def rotation(scan, previous):
    """Returns the yaw of `scan` in the frame of `previous`, rad, counter-clockwise, and its standard deviation."""
    later, earlier = spectrum(scan.raster), spectrum(previous.raster)
    scores = np.fft.ifft(np.conj(np.fft.fft(later)) * np.fft.fft(earlier)).real.sum(axis=0)
    # The spectrum of a real raster is its own half turn.
    best = int(np.argmax(scores)) % (BEARINGS // 2)
    step_rad = 2.0 * np.pi / BEARINGS
    return (best - (best > BEARINGS // 4) * BEARINGS // 2) * step_rad, step_rad


def spectrum(raster):
    """Returns the magnitudes by frequency and bearing, each frequency about its mean."""
    n = len(raster)
    window = np.hanning(n)
    magnitude = np.log1p(np.abs(np.fft.fftshift(np.fft.fft2(raster * np.outer(window, window)))))
    bearing = np.arange(BEARINGS) * 2.0 * np.pi / BEARINGS
    frequency = np.arange(n // 16, n // 2 - 1)
    row, column = n // 2 - np.outer(frequency, np.cos(bearing)), n // 2 - np.outer(frequency, np.sin(bearing))
    polar = between(magnitude, row, column)
    return polar - polar.mean(axis=1, keepdims=True)


def between(cells, row, column):
    """Returns the values between cells, linear in both directions."""
    top, left = row.astype(int), column.astype(int)
    down, right = row - top, column - left
    upper = cells[top, left] * (1 - right) + cells[top, left + 1] * right
    lower = cells[top + 1, left] * (1 - right) + cells[top + 1, left + 1] * right
    return upper * (1 - down) + lower * down
