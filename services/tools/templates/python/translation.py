"""A search for the translation between two scans whose rotation is known."""

import numpy as np


def translation(scan, previous, rotation_rad):
    """Returns the place of `scan` in the frame of `previous`: x forward, y left, m, and their standard deviation."""
    later, earlier = turned(scan.raster, rotation_rad), previous.raster
    correlation = np.fft.ifft2(np.fft.fft2(later) * np.conj(np.fft.fft2(earlier))).real
    rows, columns = np.unravel_index(np.argmax(correlation), correlation.shape)
    n = len(later)
    # Row 0 is far ahead, column 0 far left: what comes nearer moves to larger rows and columns.
    shift = [(cells + n // 2) % n - n // 2 for cells in (rows, columns)]
    return shift[0] * scan.cell_m, shift[1] * scan.cell_m, 0.5 * scan.cell_m


def turned(raster, angle_rad):
    """Returns the raster in a frame that is turned back by an angle, the nearest cell for each cell."""
    middle = 0.5 * (len(raster) - 1)
    ahead, left = np.meshgrid(middle - np.arange(len(raster)), middle - np.arange(len(raster)), indexing="ij")
    cos, sin = np.cos(angle_rad), np.sin(angle_rad)
    row = np.rint(middle - (cos * ahead + sin * left)).astype(int)
    column = np.rint(middle - (cos * left - sin * ahead)).astype(int)
    inside = (row >= 0) & (row < len(raster)) & (column >= 0) & (column < len(raster))
    return np.where(inside, raster[row.clip(0, len(raster) - 1), column.clip(0, len(raster) - 1)], 0.0)
