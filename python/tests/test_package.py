"""The documentation of all that is public, and the types."""

import ast
import os
import re
import subprocess
import sys

import gyre
from conftest import ROOT

STUBS = ast.parse((ROOT / "python/package/gyre/_gyre.pyi").read_text())


def public() -> list[tuple[str, object]]:
    """All that a user can name, with the members of classes."""
    found: list[tuple[str, object]] = []
    for name in gyre.__all__:
        thing = getattr(gyre, name)
        if name != "__version__":
            found.append((name, thing))
        if isinstance(thing, type):
            found += [(f"{name}.{member}", getattr(thing, member)) for member in vars(thing) if not member.startswith("_")]
    return found


def returns() -> dict[str, str]:
    """The types of all properties, and of what methods return."""
    classes = [stub for stub in STUBS.body if isinstance(stub, ast.ClassDef)]
    return {
        f"{stub.name}.{member.name}": ast.unparse(member.returns)
        for stub in classes
        for member in stub.body
        if isinstance(member, ast.FunctionDef) and member.returns and not member.name.startswith("_")
    }


def test_all_is_documented_in_sentences() -> None:
    for name, thing in public():
        documentation = (thing.__doc__ or "").strip()
        assert len(documentation.split()) >= 2, name
        assert documentation[0].isupper() or documentation[0] == "`", f"{name}: {documentation}"


def test_arrays_are_documented_with_type_and_shape_and_lengths_with_their_unit() -> None:
    documentation = {name: thing.__doc__ or "" for name, thing in public()}
    arrays = units = 0
    for name, returned in returns().items():
        text = f"{name}: {documentation[name]}"
        if "NDArray" in returned and "void" not in returned:
            arrays += 1
            assert re.search(r"(uint8|float32|float64|int64) \(([\w ]+, )*[\w ]+,?\)", text), text
        for suffix, unit in (("_m", "m"), ("_ns", "ns"), ("_rad", "rad"), ("_percent", "%")):
            if name.endswith(suffix):
                units += 1
                assert re.search(rf", {unit}([;:,. ]|$)", text), text
    assert arrays >= 10 and units >= 12


def test_types_are_those_of_the_stubs() -> None:
    folder = ROOT / "python"
    environment = os.environ | {"MYPY_CACHE_DIR": os.devnull}
    examples = map(str, (ROOT / "examples").glob("python-*.py"))
    checks = [
        ["mypy", "--strict", "-p", "gyre"],
        ["mypy", "--strict", "tests"],
        *(["mypy", "--strict", example] for example in examples),
        ["mypy.stubtest", "gyre", "--ignore-disjoint-bases"],
    ]
    for check in checks:
        done = subprocess.run(
            [sys.executable, "-m", *check], cwd=folder, env=environment, capture_output=True, text=True
        )
        assert done.returncode == 0, done.stdout + done.stderr
