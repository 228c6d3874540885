"""The entry point of `python -m gyre_training`; see README.md."""

import os
import sys

# malloc keeps large blocks between steps, which halves the time of a step on a CPU. Waiting threads sleep: on a machine
# that runs something else as well, spinning ones make a step ten times slower.
SETTINGS = {
    "MALLOC_MMAP_THRESHOLD_": str(1 << 33),
    "MALLOC_TRIM_THRESHOLD_": str(1 << 34),
    "MALLOC_TOP_PAD_": str(1 << 28),
    "OMP_WAIT_POLICY": "passive",
}


def main() -> None:
    if sys.platform == "linux" and not SETTINGS.keys() <= os.environ.keys():
        os.execve(sys.executable, [sys.executable, "-m", "gyre_training", *sys.argv[1:]], os.environ | SETTINGS)
    from .cli import run

    run(sys.argv[1:])


if __name__ == "__main__":
    main()
