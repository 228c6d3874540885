import pytest

from gyre_training import worlds
from gyre_training.recipe import HOME, lineage, read, search_of

ROTATION = {"form": "eq7", "window": "hann", "band_low": 0.05, "band_high": 0.45, "angles": 576, "peak": "gaussian"}
TRANSLATION = {"reach_m": 12.0, "overlap": "energy", "peak": "gaussian", "half_turn": False}
SETTINGS = {"raster": {"n": 255}, "rotation": ROTATION, "translation": TRANSLATION}


@pytest.mark.parametrize("path", sorted((HOME / "recipes").glob("*.toml")), ids=lambda path: path.stem)
def test_dependencies_of_recipes_start_from_scratch_or_from_a_model(path):
    recipes = lineage(path)
    assert recipes[-1].name == path.stem and not recipes[0].teacher
    start = recipes[0].initial_weights(path.parent)
    assert start is None or start.suffix == ".onnx" and start.exists()
    assert all(recipe.configuration.exists() for recipe in recipes)


@pytest.mark.parametrize(
    "text, reason",
    [
        ("[training]\nepoch = 3", "epoch"),
        ("initials = 3", "initials"),
        ("[distillation]\nepochs = 3", "needs a teacher"),
        ("raster = ", "Invalid value"),
    ],
)
def test_unknown_keys_of_a_recipe_are_rejected_by_name(text, reason, tmp_path):
    (tmp_path / "one.toml").write_text(text if "raster" in text else f'raster = "a"\n{text}')
    with pytest.raises(SystemExit, match=f"one.toml is not a valid recipe: .*{reason}"):
        read(tmp_path / "one.toml")


def test_both_stages_have_a_separate_sampling(tmp_path):
    (tmp_path / "one.toml").write_text('''
        raster = "a"
        teacher = "b"
        [distillation.sampling]
        steps = 2
        [training]
        epochs = 4''')
    one = read(tmp_path / "one.toml")
    assert (one.distillation.sampling.steps, one.training.sampling.steps, one.training.epochs) == (2, 3, 4)


def test_the_search_has_the_settings_of_the_configuration():
    search = search_of(SETTINGS)
    assert (search.radii, search.peak, search.overlap, search.angles) == (102, "gaussian", "energy", 576)


@pytest.mark.parametrize(
    "section, key, value",
    [("rotation", "phase_only", True), ("translation", "peak", "parabola")],
)
def test_an_unsupported_search_is_refused(section, key, value):
    with pytest.raises(SystemExit, match=key):
        search_of(SETTINGS | {section: SETTINGS[section] | {key: value}})


def test_pairs_of_other_settings_are_refused(tmp_path):
    path, raster = tmp_path / "train.npy", tmp_path / "raster.toml"
    raster.write_text("[raster]\nn = 127\n[points]\ncapacity = 0")
    path.with_suffix(".toml").write_text('[raster]\nn = 127\n[[sequences]]\nname = "a"\n[[sequences]]\nname = "b"')
    worlds.require_pairs_of(["a", "b"], raster, path)
    for names in (["a"], ["a", "b", "c"]):
        with pytest.raises(SystemExit, match="made with other settings"):
            worlds.require_pairs_of(names, raster, path)
    raster.write_text("[raster]\nn = 255")
    with pytest.raises(SystemExit, match="raster.n"):
        worlds.require_pairs_of(["a", "b"], raster, path)
