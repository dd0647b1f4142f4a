"""The TOML of a material: its defaults, and every way of getting it wrong."""

import math
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.config.models import Config
from pipeline.config.read import load, parse
from pipeline.errors import ConfigError
from pipeline.stages.render import map_name
from pipeline.tables.polar.layout import PolarLayout
from pipeline.validated import as_pair

MINIMAL = {"name": "a", "surface": {"recipe": {"kind": "mirror"}}}


def read(tmp_path, text):
    """The config of a TOML text in a file of its own."""
    path = tmp_path / "material.toml"
    path.write_text(text, encoding="utf-8")
    return load(path)


def faults(document, folder=Path()):
    """The faults of a document: messages by path of the key (the last one where a key has several)."""
    with pytest.raises(ConfigError) as error:
        parse(document, "file.toml", folder)
    return dict(error.value.faults)


def with_section(name, **keys):
    return {**MINIMAL, name: keys}


# --- what a good file gives --------------------------------------------------------------------------


def test_left_out_sections_take_their_documented_defaults(tmp_path):
    """A name and a surface are enough; all else is as the reference says."""
    config = read(tmp_path, 'name = "a"\n[surface]\nrecipe = { kind = "mirror" }\n')
    assert (config.coherence.sigma_um, config.coherence.boundary) == (16.25, "periodic")
    assert config.light.illuminant == "D65"
    assert config.light.observer == "CIE 1931 2 Degree Standard Observer"
    assert config.light.range_nm == (380.0, 780.0)
    assert (config.material.fresnel, config.material.ior, config.material.metal) == ("schlick", 1.5, "Au")
    assert (config.material.shadowing, config.material.normalisation) == (True, "absolute")
    assert config.table == PolarLayout(terms="auto", rings="auto", azimuths="auto", w_terms="auto")
    assert config.budget_delta_e == 0.1
    assert config.accuracy.exposure_ru == 7500.0
    assert config.scene is None
    assert (config.render.size, config.render.exposure_ru) == (512, 1500.0)
    assert [light.model_dump() for light in config.render.lights] == [{"theta_deg": 0.0, "phi_deg": 0.0}]


def test_the_documented_sections_are_read(tmp_path):
    """The keys of the reference, with other values than the defaults, arrive where they belong."""
    (tmp_path / "scan.spm").touch()
    config = read(
        tmp_path,
        """
        name = "elaphe"
        [surface]
        path = "scan.spm"
        channel = "Height"
        pitch_um = [0.0488, 0.05]
        height_unit = "nm"
        level = "rows"
        clip_percentile = [0.05, 99.9]
        [coherence]
        sigma_um = 10
        boundary = "periodic"
        [spectrum]
        illuminant = { lambda_nm = 532 }
        [material]
        fresnel = "conductor"
        shadowing = false
        normalisation = "absolute"
        [table]
        layout = "taylor"
        resolution = 101
        terms = 25
        [accuracy]
        delta_e = 0.1
        [scene]
        lights = [{ theta_deg = 30, phi_deg = 10 }]
        views = { theta_max_deg = 60 }
        [render]
        lights = [{ theta_deg = 30, phi_deg = 10 }]
        """,
    )
    assert config.surface.path == str(tmp_path.resolve() / "scan.spm")
    assert (config.surface.pitch_um, config.surface.clip_percentile) == ((0.0488, 0.05), (0.05, 99.9))
    assert (config.surface.levelling, config.surface.height_unit) == ("rows", "nm")
    assert config.coherence.sigma_um == 10.0
    assert config.light.illuminant.lambda_nm == 532.0
    assert (config.material.fresnel, config.material.shadowing) == ("conductor", False)
    assert (config.table.resolution, config.table.terms) == (101, 25)
    assert config.scene.views.theta_max_deg == 60.0
    assert config.accuracy.delta_e == 0.1


def test_a_scan_is_levelled_and_a_recipe_is_not():
    """Without `level`, scans lose their plane while recipes are exact as they are."""
    recipe = parse(MINIMAL, "f", Path()).surface
    scan = parse({"name": "a", "surface": {"path": Path(__file__).name}}, "f", Path(__file__).parent).surface
    assert (recipe.levelling, scan.levelling) == ("none", "plane")


def test_one_number_applies_to_both_axes():
    """A pitch or size is a number, or [x, y]."""
    assert as_pair(0.5) == (0.5, 0.5)
    assert as_pair((0.5, 0.25)) == (0.5, 0.25)
    recipe = {"kind": "mirror", "size_um": [10, 20.5], "pitch_um": 0.1}
    parsed = parse({"name": "a", "surface": {"recipe": recipe}}, "f", Path()).surface.recipe
    assert (parsed.size_um, parsed.pitch_um) == ((10.0, 20.5), 0.1)


def test_files_are_relative_to_the_config_and_not_to_the_caller(tmp_path, monkeypatch):
    """A config and its files move together; from where it is run does not matter."""
    for name in ("scan.csv", "light.csv", "metal.csv"):
        (tmp_path / name).touch()
    folder, elsewhere = tmp_path / "configs", tmp_path / "elsewhere"
    folder.mkdir()
    elsewhere.mkdir()
    (folder / "a.toml").write_text(
        'name = "a"\n[surface]\npath = "../scan.csv"\n[spectrum]\nilluminant = "../light.csv"\n'
        '[material]\nmetal = "../metal.csv"\n'
    )
    monkeypatch.chdir(elsewhere)
    config = load(Path("../configs/a.toml"))
    found = (config.surface.path, config.light.illuminant, config.material.metal)
    assert found == tuple(str(tmp_path.resolve() / name) for name in ("scan.csv", "light.csv", "metal.csv"))


def test_a_config_cannot_be_changed_after_it_was_read():
    """Digests are taken from it, so it stays what it was."""
    with pytest.raises(ValueError, match="frozen"):
        parse(MINIMAL, "f", Path()).coherence.sigma_um = 1.0


# --- what a bad file says ----------------------------------------------------------------------------


def test_every_fault_is_reported_at_once(tmp_path):
    """One run reports all faults, each with the path of its key, including those of files and names."""
    with pytest.raises(ConfigError) as error:
        read(
            tmp_path,
            """
            name = "not a name"
            colour = 1
            [surface]
            path = "nowhere.spm"
            clip_percentile = [90, 10]
            [coherence]
            sigma_um = -1
            sigma = 3
            [spectrum]
            illuminant = "D66"
            observer = "nobody"
            range_nm = [780, 380]
            [material]
            metal = "Ag"
            ior = 0.5
            [table]
            layout = "taylor"
            resolution = 500
            [render]
            lights = [{ theta_deg = 0 }, { theta_deg = 90, fi = 1 }]
            """,
        )
    assert {key for key, _ in error.value.faults} == {
        "name",
        "colour",
        "surface.path",
        "surface.clip_percentile",
        "coherence.sigma_um",
        "coherence.sigma",
        "spectrum.illuminant",
        "spectrum.observer",
        "spectrum.range_nm",
        "material.metal",
        "material.ior",
        "table.resolution",
        "render.lights.1.theta_deg",
        "render.lights.1.fi",
    }
    lines = str(error.value).splitlines()
    assert len(lines) == len(error.value.faults)
    assert all(line.startswith(f"{tmp_path / 'material.toml'}: ") for line in lines)


@pytest.mark.parametrize(
    ("document", "key", "said"),
    [
        ({"surface": MINIMAL["surface"]}, "name", "required"),
        ({"name": "a"}, "surface", "required"),
        ({**MINIMAL, "surface": {}}, "surface", "neither"),
        (with_section("surface", level="none"), "surface", "neither"),
        (with_section("surface", path=Path(__file__).name, recipe={"kind": "mirror"}), "surface", "both"),
        (with_section("surface", recipe={"kind": "mirror"}, channel="Height"), "surface", "channel"),
        (with_section("surface", recipe={"kind": "mirror"}, pitch_um=1), "surface", "pitch_um"),
        (with_section("surface", recipe={"kind": "moon"}), "surface.recipe", "'moon'"),
        (with_section("surface", recipe={}), "surface.recipe", "kind"),
        (with_section("surface", recipe={"kind": "blazed", "duty": 1}), "surface.recipe.duty", "unknown key"),
        # names of kinds and of types are keys like others where the user writes them
        (with_section("surface", recipe={"kind": "cd", "mirror": 1}), "surface.recipe.mirror", "unknown key"),
        (with_section("surface", gaussian={}), "surface.gaussian", "unknown key"),
        (with_section("table", float=1), "table.float", "unknown key"),
        (with_section("surface", path="."), "surface.path", "expected a file, got a folder"),
        (with_section("surface", path="C:\\scans\\a.txt"), "surface.path", "write / between folders"),
        (with_section("surface", path="a\0b"), "surface.path", "null"),
        (with_section("surface", path="x" * 5000), "surface.path", "cannot be read"),
        (with_section("spectrum", illuminant="nowhere.CSV"), "spectrum.illuminant", "no such file"),
        (with_section("material", metal="nowhere.csv"), "material.metal", "no such file"),
        (with_section("spectrum", range_nm=[300, 700]), "spectrum.range_nm", "360..830"),
        (with_section("table", layout="square"), "table", "a layout, one of polar, taylor"),
        (with_section("table", resolution=501), "table.resolution", "unknown key"),
        (with_section("table", azimuths=100), "table.azimuths", "multiple of 32"),
        (with_section("table", w_terms=6), "table.w_terms", "multiple of 4"),
        (with_section("table", layout="taylor", rings=100), "table.rings", "unknown key"),
        (with_section("table", layout="taylor", resolution=500), "table.resolution", "odd"),
        (with_section("table", terms=0), "table.terms", "greater than or equal to 2"),
        (with_section("render", lights=[]), "render.lights", "at least 1"),
        ({**MINIMAL, "table": {"layout": "taylor"}, "publish": {"textures": 3}}, "publish.textures", "polar"),
        (with_section("scene"), "scene.lights", "required"),
        ({**MINIMAL, "name": "../a"}, "name", "pattern"),
        ({**MINIMAL, "name": "a\n"}, "name", "pattern"),
        ({**MINIMAL, "name": "a" * 65}, "name", "pattern"),
    ],
)
def test_a_fault_names_its_key_and_the_reason(document, key, said):
    """A fault's key path is the user's own, and its sentence tells what was expected or found."""
    found = faults(document, Path(__file__).parent)
    assert set(found) == {key}
    assert said in found[key]


@pytest.mark.parametrize("value", ["5", True, math.nan, math.inf, -math.inf, None, [], {}, -1.0, 0])
@pytest.mark.parametrize("section", [("coherence", "sigma_um"), ("render", "exposure_ru"), ("table", "step_nm")])
def test_only_positive_finite_numbers_are_lengths_exposures_and_steps(section, value):
    """ "5" is no number, true is none, and neither NaN nor infinity is a size."""
    name, key = section
    layout = {"layout": "taylor"} if name == "table" else {}
    assert list(faults(with_section(name, **layout, **{key: value}))) == [f"{name}.{key}"]


@pytest.mark.parametrize("key", ["theta_deg", "phi_deg"])
@pytest.mark.parametrize("value", ["5", True, math.nan, math.inf, None])
def test_only_finite_numbers_are_angles(key, value):
    """An angle may be anything but text, truth or no number at all."""
    light = {"theta_deg": 0.0, "phi_deg": 0.0, key: value}
    assert list(faults(with_section("render", lights=[light]))) == [f"render.lights.0.{key}"]


@pytest.mark.parametrize("pair", [[1.0, -1.0], [0, 1], [math.nan, 1.0], [1.0, math.inf], [True, 1.0], ["1", 2.0]])
@pytest.mark.parametrize("key", ["size_um", "pitch_um", "correlation_um"])
def test_both_numbers_of_a_pair_are_checked(key, pair):
    """[x, y] must be two positive finite lengths."""
    found = faults(with_section("surface", recipe={"kind": "gaussian", key: pair}))
    bad = [i for i, v in enumerate(pair) if isinstance(v, bool | str) or not 0 < v < math.inf]
    assert f"surface.recipe.{key}.{bad[0]}" in found


def test_a_laser_line_is_a_visible_wavelength():
    """Where the observer sees nothing there is no light to bake."""
    found = faults(with_section("spectrum", illuminant={"lambda_nm": 900}))
    assert "830" in found["spectrum.illuminant.lambda_nm"]


def test_a_seed_is_no_negative_number():
    """Random generators take none, so the config does not either."""
    assert list(faults(with_section("surface", recipe={"kind": "cd", "seed": -1}))) == ["surface.recipe.seed"]


@pytest.mark.parametrize(
    "observer", ["Stockman & Sharpe 2 Degree Cone Fundamentals", "Wright & Guild 1931 2 Degree RGB CMFs"]
)
def test_matching_functions_that_give_no_xyz_are_no_observer(observer):
    """Responses of cones or RGB primaries would be taken for XYZ."""
    assert list(faults(with_section("spectrum", observer=observer))) == ["spectrum.observer"]
    other = with_section("spectrum", observer="CIE 2015 2 Degree Standard Observer")
    assert parse(other, "f", Path()).light.observer.startswith("CIE 2015")


def scene_and_render(scene, render):
    return {**MINIMAL, "scene": {"lights": scene}, "render": {"lights": render}}


def test_a_light_to_render_must_be_one_of_the_scenes():
    """The table holds only what the scene's lights reach: others would be rendered dark."""
    left_out = scene_and_render([{"theta_deg": 30}], [{"theta_deg": 30}, {"theta_deg": 20}])
    found = faults(left_out)
    assert list(found) == ["render.lights.1"]
    assert found["render.lights.1"].startswith("expected a light of [scene]")


def test_maps_without_lights_of_their_own_take_the_scenes():
    config = parse(with_section("scene", lights=[{"theta_deg": 30}]), "f", Path())
    assert [light.theta_deg for light in config.render.lights] == [30.0]
    assert config.render.size == 512


@pytest.mark.parametrize(
    ("scene", "render"),
    [
        ({"theta_deg": 30, "phi_deg": 10}, {"theta_deg": 30, "phi_deg": 370}),
        ({"theta_deg": 30, "phi_deg": -90}, {"theta_deg": 30, "phi_deg": 270}),
        ({"theta_deg": 0, "phi_deg": 10}, {"theta_deg": 0}),
    ],
)
def test_the_same_light_may_be_written_differently(scene, render):
    """Whole turns of the azimuth, and any azimuth of the normal, are the same direction."""
    assert parse(scene_and_render([scene], [render]), "f", Path()).scene is not None


# --- files that are no config ------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("data", "said"),
    [
        (b"name = ", "not valid TOML"),
        (b'[surface]\npath = "C:\\Users\\me\\scan.txt"\n', "in a path, write / instead of"),
        (b'name = "a"\nname = "b"\n', "not valid TOML"),
        (b"name = " + b"9" * 5000, "not valid TOML"),
        (b"name = " + b"[" * 100_000, "not valid TOML"),
        (b"\x89PNG\r\n\x1a\n\x00\xff\xfe", "UTF-8"),
    ],
    ids=["syntax", "backslashes", "key twice", "endless number", "endless nesting", "binary"],
)
def test_a_file_that_is_no_toml_is_a_config_fault(tmp_path, data, said):
    """The file is named, with what kept it from being read."""
    path = tmp_path / "a.toml"
    path.write_bytes(data)
    with pytest.raises(ConfigError) as error:
        load(path)
    assert str(error.value).startswith(f"{path}: ")
    assert said in str(error.value)


def test_a_missing_file_and_a_folder_are_config_faults(tmp_path):
    """Neither is read, and the message says which it was."""
    with pytest.raises(ConfigError, match="no such config file"):
        load(tmp_path / "nowhere.toml")
    with pytest.raises(ConfigError, match="cannot be read"):
        load(tmp_path)


# --- anything at all ---------------------------------------------------------------------------------

KEYS = sorted(
    {key for section in Config.model_fields.values() for key in getattr(section.annotation, "model_fields", {})}
    | set(Config.model_fields)
    | {"kind", "size_um", "seed", "theta_deg", "phi_deg", "lambda_nm", "float"}
)
WORDS = ["mirror", "gaussian", "cd", "D65", "E", "Au", "auto", "taylor", "a.csv", "um", "plane", "1.0.0", "\0.csv"]
leaves = (
    st.none()
    | st.booleans()
    | st.integers()
    | st.floats()
    | st.text(max_size=8)
    | st.sampled_from(WORDS)
    | st.dates()
)
values = st.recursive(
    leaves,
    lambda inner: (
        st.lists(inner, max_size=3) | st.dictionaries(st.sampled_from(KEYS) | st.text(max_size=5), inner, max_size=4)
    ),
    max_leaves=12,
)


@pytest.mark.slow
@settings(max_examples=300, deadline=None)
@given(sections=st.dictionaries(st.sampled_from(sorted(Config.model_fields)) | st.text(max_size=5), values))
def test_no_document_makes_anything_but_a_config_or_a_config_fault(tmp_path_factory, sections):
    """Any TOML document gives a config or the list of its faults."""
    for document in (sections, {**MINIMAL, **sections}):
        try:
            config = parse(document, "f", tmp_path_factory.getbasetemp())
        except ConfigError as error:
            found = error
        else:
            found = config
        assert isinstance(found, Config) or all(text for _, text in found.faults)


@settings(max_examples=200, deadline=None)
@given(data=st.binary(max_size=60) | st.text(max_size=60).map(str.encode))
def test_no_file_makes_anything_but_a_config_fault(tmp_path_factory, data):
    """Sixty bytes are too few for a config; none of them is a crash."""
    path = tmp_path_factory.getbasetemp() / "anything.toml"
    path.write_bytes(data)
    with pytest.raises(ConfigError):
        load(path)


def test_a_laser_line_has_no_range():
    found = faults(with_section("spectrum", illuminant={"lambda_nm": 532}, range_nm=[400, 700]))
    assert "no meaning with a laser line" in found["spectrum"]


def test_lights_that_would_share_a_map_are_reported():
    """10 and 370 degrees of azimuth are one light; a millionth of a degree apart they are two, with two maps."""
    lights = [{"theta_deg": 30, "phi_deg": 10}, {"theta_deg": 30, "phi_deg": 370}]
    assert faults(with_section("render", lights=lights)) == {"render.lights.1": "the same light as render.lights.0"}
    apart = [{"theta_deg": 10.0}, {"theta_deg": 10.00001}]
    config = parse(with_section("render", lights=apart), "f", Path())
    assert len({map_name(light) for light in config.render.lights}) == 2
