"""Configurations, and what they refuse."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import gyre
import numpy as np
import pytest

CONFIGS = Path(__file__).parents[2] / "configs"


def test_a_configuration_is_its_sections() -> None:
    config = gyre.Config({"masking": {"threshold": np.int64(70)}, "raster": {"cell_m": np.float32(0.5)}})
    assert config.to_dict()["masking"]["threshold"] == 70
    assert config.to_dict()["raster"]["cell_m"] == 0.5
    assert config != gyre.Config()
    assert gyre.Config(config.to_dict()) == config
    assert gyre.Config({"masking": {"model": None}}) == gyre.Config()


def test_a_configuration_can_be_written_and_read(tmp_path: Path) -> None:
    config = gyre.Config.read(CONFIGS / "radiate.toml")
    (tmp_path / "config.toml").write_text(str(config))
    assert gyre.Config.read(tmp_path / "config.toml") == config


def test_all_configurations_of_the_repository_are_read() -> None:
    for file in CONFIGS.glob("*.toml"):
        gyre.Config.read(file)


def test_overrides_replace_keys() -> None:
    config = gyre.Config.read(CONFIGS / "radiate.toml", {"masking.kind": "none", "refinement.keyframes": 9})
    assert config.to_dict()["masking"]["kind"] == "none"
    assert config.to_dict()["refinement"]["keyframes"] == 9


def test_settings_that_are_found_say_what_they_are(recording: Path) -> None:
    config = gyre.Config.of(recording, {"masking.threshold": 77})
    assert config.note is not None and "noise floor" in config.note
    assert config.to_dict()["masking"]["threshold"] == 77
    assert gyre.Config().note is None


def itself() -> dict[str, Any]:
    sections: dict[str, Any] = {}
    sections["masking"] = sections
    return sections


@pytest.mark.parametrize(
    ("sections", "sentence"),
    [
        ({"masking": {"treshold": 70}}, "did you mean `threshold`"),
        ({"maskin": {}}, "did you mean `masking`"),
        ({"run": {"rate": 1}}, "has no key `run`"),
        ({"masking": {"threshold": 700}}, "masking"),
        ({"masking": {"threshold": -1}}, "masking"),
        ({"masking": {"threshold": "70"}}, "masking"),
        ({"masking": {"threshold": float("nan")}}, "masking"),
        ({"raster": {"n": 2**70}}, "raster"),
        ({"raster": {"cell_m": float("nan")}}, "raster"),
        ({"masking": 3}, "masking"),
        ({"masking": {"kind": b"none"}}, "type bytes"),
        ({"masking": {"kind": slice(1)}}, "type slice"),
        ({1: {}}, "not a str"),
        (itself(), "too many levels"),
        ({"dataset": {"range_resolution_m": -1.0}}, "range_resolution_m"),
    ],
    ids=str,
)
def test_what_is_unknown_or_out_of_bounds_is_refused(sections: Any, sentence: str) -> None:
    with pytest.raises(gyre.ConfigError, match=sentence) as refused:
        gyre.Config(sections)
    assert isinstance(refused.value, (gyre.Error, ValueError))


@pytest.mark.parametrize("key", ["masking", "", ".", "masking.", "a=b.c", "masking.kind.x", "run.rate", 3])
def test_overrides_of_no_key_are_refused(key: Any) -> None:
    with pytest.raises(gyre.ConfigError):
        gyre.Config.read(CONFIGS / "radiate.toml", {key: "none"})


def test_a_network_that_is_missing_is_refused() -> None:
    with pytest.raises(gyre.ConfigError, match="nowhere"):
        gyre.Odometry(gyre.Config({"masking": {"kind": "learned", "model": Path("nowhere.toml")}}))


@pytest.mark.parametrize(
    "call",
    [
        lambda untyped: untyped.Config(3),
        lambda untyped: untyped.Config.read(None),
        lambda untyped: untyped.Config.of(3),
        lambda untyped: untyped.Odometry({"masking": {}}),
        lambda untyped: untyped.Odometry().register(None),
        lambda untyped: untyped.Odometry().register(np.zeros((4, 4), np.uint8)),
        lambda untyped: untyped.Masker().mask(3),
        lambda untyped: untyped.open(None),
        lambda untyped: untyped.evaluate(None, None),
        lambda untyped: untyped.inspect(3),
        lambda untyped: untyped.Slam(),
    ],
)
def test_types_are_checked(call: Callable[[Any], object]) -> None:
    with pytest.raises(TypeError):
        call(gyre)
