"""A mask: which returns count, for the search and for the points."""


def mask(scan):
    """Returns factors from 0 to 1 in the shape of scan.power (azimuths x bins) or of scan.raster (n x n, row 0 far ahead)."""
    return scan.power > 70
