"""The exceptions of the package. Their messages are sentences that say what is wrong, where, and what to do."""


class Error(Exception):
    """Any error of the package but those of wrong types (TypeError) and indices (IndexError)."""


class ConfigError(Error, ValueError):
    """An invalid configuration: an unknown key, a value out of its bounds, a network that cannot be used."""


class ReadError(Error, OSError):
    """A recording, a scan or a trajectory that cannot be read."""


class WriteError(Error, OSError):
    """A file that cannot be written."""


class ScanError(Error, ValueError):
    """A scan that cannot be used: it is inconsistent, or its times are not those of one sweep."""


class TrajectoryError(Error, ValueError):
    """Trajectories that cannot be compared or drawn."""


class RunError(Error):
    """A run that is not running, has no such topic or process, or does not answer."""


class SkippedScanWarning(UserWarning):
    """A scan of a recording is damaged and was skipped."""
