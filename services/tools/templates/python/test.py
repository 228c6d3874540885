"""Tests the stage by its contract: `python3 test_@function@.py`, or pytest."""

import pathlib
import subprocess

SOURCE = pathlib.Path(__file__).with_name("@function@.py")


def test_it_keeps_the_contract_of_its_stage():
    subprocess.run(["gyre", "conformance", "@stage@", "--python", str(SOURCE)], check=True)


if __name__ == "__main__":
    test_it_keeps_the_contract_of_its_stage()
