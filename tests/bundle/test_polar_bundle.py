"""Polar tables in a bundle: their manifest, few textures, half floats, and missed budgets."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import OpenEXR
import pytest
from pydantic import TypeAdapter

from pipeline.accuracy import checks
from pipeline.accuracy.certificate import Certificate
from pipeline.accuracy.checks import RANDOM_DIRECTIONS
from pipeline.bundle.manifest import Manifest
from pipeline.bundle.polar import atlas, storage
from pipeline.bundle.polar.layout import MirrorLoss, PolarGridEntry, PolarLoss
from pipeline.bundle.verify import open_bundle, verify
from pipeline.config.models import Config
from pipeline.diffraction.tiles import Tiles
from pipeline.errors import AccuracyError, ConfigError
from pipeline.optics.colour import ColourError, delta_e
from pipeline.progress import silent
from pipeline.report import images
from pipeline.scene.pairs import random_pairs
from pipeline.stages import run, surface
from pipeline.stages.polar import table as polar_table
from pipeline.stages.stage import Inputs
from pipeline.store.store import Artifact
from pipeline.tables.evaluate import Map, table_evaluator

from .conftest import SCENE, Baker, publish, small
from .test_publish import manifest_of

# between the error of the table itself and that of one texture of it
BUDGET = 2.0


@pytest.fixture(scope="module")
def bundle(bake: Baker, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return publish(small("polar"), bake(small("polar")), tmp_path_factory.mktemp("out"))


def published_with(bake: Baker, out: Path, **keys: Any) -> tuple[Path, Manifest]:
    config = small("polar", publish=keys)
    folder = publish(config, bake(config), out)
    return folder, manifest_of(folder)


def grid_of(manifest: Manifest) -> PolarGridEntry:
    assert isinstance(manifest.grid, PolarGridEntry)
    return manifest.grid


def loss_of(manifest: Manifest) -> PolarLoss:
    assert isinstance(manifest.storage_loss, PolarLoss)
    return manifest.storage_loss


def mirror_of(manifest: Manifest) -> MirrorLoss:
    loss = loss_of(manifest)
    assert loss.mirror is not None
    return loss.mirror


def test_texels_are_the_tables_coefficients(bake: Baker, bundle: Path) -> None:
    table, manifest = polar_table.load(bake(small("polar"))["table"]), manifest_of(bundle)
    assert [entry.file for entry in manifest.tables] == [f"tables/T_{q:02d}.exr" for q in range(9)]
    assert grid_of(manifest).basis is None
    assert manifest.storage_loss is None
    outputs = table.values.reshape(table.grid.rings.count, -1, table.grid.azimuths.count)
    places = atlas.place(table.tiles)
    assert len(set(places.tiles.every)) > 1
    picture = places.packed(outputs)
    np.testing.assert_allclose(places.unpacked(picture), outputs, rtol=1e-5, atol=1e-6 * np.abs(outputs).max())
    for entry in manifest.tables:
        with OpenEXR.File(str(bundle / entry.file), separate_channels=True) as file:
            pixels = [file.channels()[name].pixels for name in "RGBA"]
        for c, plane in enumerate(pixels):
            np.testing.assert_array_equal(plane, picture[4 * entry.index + c])


def test_a_bundle_with_absent_tiles_says_what_it_covers(
    bake: Baker, bundle: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole = polar_table.tiles_of

    def half(artifact: Artifact) -> Tiles:
        found = whole(artifact)
        covered = found.covered.copy()
        covered[:, 1] = False
        return replace(found, covered=covered)

    monkeypatch.setattr(polar_table, "tiles_of", half)
    folder = publish(small("polar"), bake(small("polar")), tmp_path)
    assert verify(folder) == []
    manifest = manifest_of(folder)
    assert grid_of(manifest).covered_share == pytest.approx(0.5, abs=0.01)
    assert "absent tiles, which are 50 % of the disc" in (folder / "README.md").read_text(encoding="utf-8")
    wi, wr = random_pairs(None, 4000, 1)
    found, expected = open_bundle(folder).xyz(wi, wr), open_bundle(bundle).xyz(wi, wr)
    known = np.isfinite(found).all(axis=1)
    assert known.mean() == pytest.approx(0.47, abs=0.03)
    np.testing.assert_array_equal(found[known], expected[known])
    assert np.isnan(found[~known]).all()


def test_the_manifests_mapping_is_that_of_the_grid(bake: Baker, bundle: Path) -> None:
    table, entry = polar_table.load(bake(small("polar"))["table"]), grid_of(manifest_of(bundle))
    assert (entry.rings, entry.azimuths) == (80, 256)
    rho = entry.r0 * np.sinh(np.arange(entry.rings) * entry.step)
    np.testing.assert_allclose(rho, table.grid.rings.rho(), rtol=1e-12)
    phi = table.grid.azimuths.phi()
    u, v = np.cos(phi), np.sin(phi)
    cos, sin = np.cos(entry.axis_rad), np.sin(entry.axis_rad)
    turns = np.arctan2(cos * v - sin * u, entry.stretch * (cos * u + sin * v)) / (2.0 * np.pi)
    count = entry.azimuths
    off = (turns % 1.0 * count - np.arange(count) + 0.5 * count) % count - 0.5 * count
    np.testing.assert_allclose(off, 0.0, atol=1e-9)


def test_the_manifest_has_certificate_plan_and_stages(bake: Baker, bundle: Path) -> None:
    inputs, manifest = bake(small("polar")), manifest_of(bundle)
    assert manifest.certificate == TypeAdapter(Certificate).validate_python(inputs["table"].summary["certificate"])
    assert (manifest.plan["w_terms"], manifest.plan["windows"]) == (12, inputs["power_spectrum"].summary["windows"])
    assert list(manifest.provenance.artifacts) == [
        *("surface", "power_spectrum", "table", "textures", "render", "validate")
    ]
    assert manifest.made_by.stages.keys() == manifest.provenance.artifacts.keys()
    assert manifest.colour.step_nm is None
    assert manifest.colour.wavelengths == inputs["table"].summary["wavelengths"]
    assert manifest.coverage.unknown_share == inputs["table"].summary["unknown_share"]


def test_the_readme_shows_the_certificate_and_its_own_numbers(bundle: Path) -> None:
    text, manifest = (bundle / "README.md").read_text(encoding="utf-8"), manifest_of(bundle)
    assert f"RU is {manifest.certificate.measured:.3g}" in text
    for name, value in (("RINGS", 80), ("AZIMUTHS", 256), ("TEXTURES", 9), ("TERMS", 12)):
        assert f"const int {name} = {value};" in text
    for name, number in (("R0", grid_of(manifest).r0), ("STEP", grid_of(manifest).step)):
        assert f"const float {name} = {number!r};" in text


def test_the_address_of_a_bundle_depends_on_config_and_inputs(bake: Baker) -> None:
    keys = {name: artifact.key for name, artifact in bake(small("polar")).items()}

    def address(config: Config, inputs: dict[str, str]) -> str:
        return run.stages(config)[-1].key(config, inputs)

    same = address(small("polar"), keys)
    assert address(small("polar"), keys) == same
    assert address(small("polar"), {**keys, "table": "another"}) != same
    assert address(small("polar", publish={"textures": 2}), keys) != same


@pytest.mark.parametrize(
    ("keys", "textures", "kind"),
    [
        ({"textures": 3}, 3, np.float32),
        ({"textures": 3, "precision": "half"}, 3, np.float16),
        ({"textures": "full", "precision": "half"}, 9, np.float16),
        ({"textures": 100, "precision": "half"}, 9, np.float16),
    ],
)
def test_a_bundle_has_the_error_that_it_states(
    bake: Baker, tmp_path: Path, keys: dict[str, Any], textures: int, kind: type
) -> None:
    folder, manifest = published_with(bake, tmp_path, **keys)
    assert verify(folder) == []
    assert len(manifest.tables) == textures == loss_of(manifest).textures
    with OpenEXR.File(str(folder / manifest.tables[-1].file), separate_channels=True) as file:
        assert {channel.pixels.dtype for channel in file.channels().values()} == {np.dtype(kind)}
    wi, wr = random_pairs(None, RANDOM_DIRECTIONS, storage._SEED)
    table = table_evaluator(polar_table.load(bake(small("polar"))["table"]), small("polar").radiometry)
    evaluate = open_bundle(folder).xyz
    mirror, unit = wi * [-1.0, -1.0, 1.0], small("polar").radiometry.unit
    for views, error in ((wr, loss_of(manifest).added), (mirror, mirror_of(manifest).added)):
        found = delta_e(evaluate(wi, views) / unit, table(wi, views) / unit, error.exposure_ru)
        assert found.mean() == pytest.approx(error.mean, rel=1e-2, abs=1e-4)
    assert f"in {textures} of 9 textures" in (folder / "README.md").read_text(encoding="utf-8")


@pytest.mark.slow
def test_more_textures_have_a_smaller_error(bake: Baker, tmp_path: Path) -> None:
    errors = [loss_of(published_with(bake, tmp_path, textures=n)[1]).added.mean for n in (1, 3, 6, 9)]
    assert errors == sorted(errors, reverse=True)
    assert errors[-1] < 1e-9 < errors[-2] < 0.2 * errors[0]


def test_the_manifest_has_the_share_of_subnormal_halves(bake: Baker, tmp_path: Path) -> None:
    folder, manifest = published_with(bake, tmp_path, textures=2, precision="half")
    shares = []
    for entry in manifest.tables:
        with OpenEXR.File(str(folder / entry.file), separate_channels=True) as file:
            pixels = np.abs(np.stack([channel.pixels for channel in file.channels().values()]).astype(np.float32))
        assert 2.0**14 <= pixels.max() <= 2.0**15
        shares.append(np.mean((pixels > 0.0) & (pixels < 2.0**-14)))
        assert entry.half_subnormal_share == pytest.approx(shares[-1])
    assert loss_of(manifest).subnormal_share == pytest.approx(np.mean(shares))


def budgeted(**publish: Any) -> Any:
    return small("polar", accuracy={"delta_e": BUDGET}, publish={"precision": "half", **publish})


@pytest.mark.slow
def test_auto_takes_the_fewest_textures_within_the_budget(bake: Baker, tmp_path: Path) -> None:
    loss = loss_of(manifest_of(publish(budgeted(), bake(budgeted()), tmp_path)))
    assert loss.error.mean <= BUDGET
    assert 1 < loss.textures < 9
    fewer = budgeted(textures=loss.textures - 1)
    with pytest.raises(AccuracyError, match=rf"Set publish\.textures above {loss.textures - 1}, of 9$"):
        publish(fewer, bake(fewer), tmp_path)
    assert len(list(tmp_path.iterdir())) == 1


@pytest.mark.slow
def test_auto_takes_all_textures_if_no_number_keeps_the_budget(bake: Baker, monkeypatch: pytest.MonkeyPatch) -> None:
    tried = []
    measure = storage._Measure.__call__

    def hopeless(self: storage._Measure, stored: storage.Stored) -> PolarLoss:
        tried.append(stored.textures.count)
        found = measure(self, stored)
        return found.model_copy(
            update={"error": ColourError(exposure_ru=7500.0, mean=200.0, percentile_99=0.0, maximum=0.0)}
        )

    monkeypatch.setattr(storage._Measure, "__call__", hopeless)
    with pytest.raises(AccuracyError, match=r'9 textures .* Set publish\.precision = "float"$'):
        # another budget than elsewhere, whose textures are in the store
        bake(small("polar", accuracy={"delta_e": BUDGET - 0.5}, publish={"precision": "half"}))
    assert tried == list(range(1, 10))


@pytest.mark.parametrize(("layout", "textures"), [("polar", 2), ("taylor", "auto")])
def test_maps_and_certificate_are_those_of_the_stored_tables(
    bake: Baker, tmp_path: Path, layout: str, textures: object
) -> None:
    config = small(layout, publish={"precision": "half", "textures": textures})
    inputs = bake(config)
    folder = publish(config, inputs, tmp_path)
    manifest, bundle, views = manifest_of(folder), open_bundle(folder), Map(config.render.size)
    wr = views.views()
    own = views.image(bundle.xyz(np.broadcast_to([0.0, 0.0, 1.0], wr.shape), wr))
    shown = images.read_xyz(folder / manifest.maps[0].file)
    np.testing.assert_allclose(shown, own, rtol=1e-4, atol=1e-6 * own.max())
    table = inputs["table"].summary["certificate"]
    assert manifest.certificate.measured != table["measured"]
    wi, wr = random_pairs(None, RANDOM_DIRECTIONS, checks._SEED)
    found = bundle.signed(wi, wr)
    clamped = manifest.certificate.random.clamped
    assert clamped.share == pytest.approx(np.mean(np.any(found < 0.0, axis=1)), abs=2e-2)
    truth = surface.reference_of(config, Inputs(inputs), silent).xyz(config.light, config.material, wi, wr)
    unit = config.radiometry.unit
    error = delta_e(np.maximum(found, 0.0) / unit, truth / unit, manifest.certificate.exposure_ru).mean()
    assert manifest.certificate.measured == pytest.approx(error, rel=1e-2)
    assert f"RU is {manifest.certificate.measured:.3g}" in (folder / "README.md").read_text(encoding="utf-8")


def test_one_texture_keeps_the_highlight(bake: Baker, tmp_path: Path) -> None:
    folder, manifest = published_with(bake, tmp_path, textures=1, precision="half")
    assert mirror_of(manifest).y.maximum < 0.01
    assert mirror_of(manifest).kept
    assert "the highlight is kept" in (folder / "README.md").read_text(encoding="utf-8")


def test_a_destroyed_highlight_is_judged(bake: Baker, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(storage, "_MIRROR_KEPT", 0.0)
    # no other test shares these textures
    folder, manifest = published_with(bake, tmp_path, textures=5, precision="half")
    assert not mirror_of(manifest).kept
    assert "**visibly changed**" in (folder / "README.md").read_text(encoding="utf-8")


@pytest.mark.parametrize("textures", [0, -1, 2.5, "some"])
def test_textures_must_be_a_positive_number(textures: object) -> None:
    with pytest.raises(ConfigError, match=r"publish\.textures"):
        small("polar", publish={"textures": textures})


def test_a_scenes_bundle_states_the_skipped_share(bake: Baker, tmp_path: Path) -> None:
    config = small("polar", scene=SCENE, render={"lights": SCENE["lights"]}, publish={"textures": 3})
    manifest = manifest_of(publish(config, bake(config), tmp_path))
    grid = grid_of(manifest)
    assert manifest.coverage.skipped_share == pytest.approx(1.0 - grid.covered_share * (grid.rho_max / 2.0) ** 2)
    assert manifest.coverage.skipped_share > 0.3
    assert loss_of(manifest).error.mean < 10.0
