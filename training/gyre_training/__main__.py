"""python -m gyre_training: see README.md."""

import os
import sys

# Large blocks are kept instead of given back and asked for again at each step: halves the time of a step on a CPU.
# Threads that wait sleep: where something else runs beside, spinning ones make a step ten times slower.
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
