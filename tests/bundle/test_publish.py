"""Publication: the files of a bundle, its name, and folders that exist already or cannot be written."""

import json
import os
import platform
import re
import socket
import stat
from pathlib import Path

import numpy as np
import OpenEXR
import pytest
from PIL import Image

from pipeline.accuracy import scalar_domain
from pipeline.bundle import checksums
from pipeline.bundle.manifest import Manifest
from pipeline.bundle.taylor.layout import TaylorGridEntry
from pipeline.bundle.verify import verify
from pipeline.errors import DamagedError, StorageError
from pipeline.optics import colour
from pipeline.report import images
from pipeline.stages.taylor import table as taylor_table
from pipeline.surface.periods import Period
from pipeline.tables.taylor import grid

from .conftest import SCENE, Baker, publish, small


def manifest_of(folder: Path) -> Manifest:
    return Manifest.model_validate_json((folder / "manifest.json").read_text(encoding="utf-8"))


@pytest.fixture(scope="module")
def bundle(bake: Baker, tmp_path_factory: pytest.TempPathFactory) -> Path:
    config = small()
    return publish(config, bake(config), tmp_path_factory.mktemp("out"))


def test_a_fresh_bundle_has_no_faults(bundle: Path) -> None:
    assert verify(bundle) == []


def test_the_folder_is_named_by_its_content(bundle: Path) -> None:
    assert bundle.name == f"small-1.0.0+{checksums.of_sums(bundle)}"


def test_the_files_of_a_bundle(bundle: Path) -> None:
    names = {path.relative_to(bundle).as_posix() for path in bundle.rglob("*") if path.is_file()}
    powers = len(manifest_of(bundle).tables)
    assert names == {
        *(f"tables/I_{p:02d}.exr" for p in range(powers)),
        *("manifest.json", "evaluate.py", "README.md", "SHA256SUMS", "report.html"),
        *("maps/map_theta0_phi0.exr", "maps/map_theta0_phi0.png"),
    }


def test_texels_are_the_table(bake: Baker, bundle: Path) -> None:
    table = taylor_table.load(bake(small())["table"])
    for entry in manifest_of(bundle).tables:
        with OpenEXR.File(str(bundle / entry.file), separate_channels=True) as file:
            assert file.header()["colorInteropID"] == "data"
            channels = {name: channel.pixels for name, channel in file.channels().items()}
        for c, name in enumerate("RGB"):
            np.testing.assert_array_equal(channels[name], table.values[:, :, c, entry.index])
        np.testing.assert_array_equal(channels["A"] == 1.0, table.computed)


def test_the_manifests_mapping_is_that_of_the_grid(bundle: Path) -> None:
    entry = manifest_of(bundle).grid
    assert isinstance(entry, TaylorGridEntry)
    t = 2.0 * np.arange(entry.width) / (entry.width - 1) - 1.0
    u = entry.u_max * np.abs(t) ** entry.power * np.sign(t)
    np.testing.assert_allclose(u, grid.nodes(entry.width, entry.power), rtol=1e-14, atol=1e-15)
    assert (entry.width, entry.height) == (41, 41)


def test_the_manifest_has_errors_coverage_and_origin(bake: Baker, bundle: Path) -> None:
    inputs, manifest = bake(small()), manifest_of(bundle)
    assert manifest.measured_error == inputs["validate"].summary
    assert manifest.plan["order"] == inputs["stack"].summary["order"]
    assert manifest.coverage.unknown_share == inputs["table"].summary["unknown_share"]
    # the Nyquist limit of a pitch of 0.1 um is 5 per um, which light of 380 nm reaches at 5 * 0.38
    assert manifest.coverage.known_radius == pytest.approx(1.9)
    assert manifest.provenance.artifacts == {name: artifact.key for name, artifact in inputs.items()}
    assert (manifest.made_by.device, manifest.made_by.driver) == ("a device", "1.0")
    assert manifest.made_by.libraries["zarr"] == "not recorded"
    assert manifest.licence == "not stated"


def test_the_manifest_has_the_scalar_models_domain(bake: Baker, bundle: Path) -> None:
    domain, statistics = manifest_of(bundle).domain, bake(small())["surface"].summary["statistics"]
    finest = scalar_domain.finest_period_um([Period(**period) for period in statistics["periods"]])
    assert domain.lambda_nm == 550.0
    assert domain.period_over_lambda == pytest.approx(finest / 0.55)
    found = scalar_domain.place(finest, statistics["sigma_h_um"], 550.0)
    assert (domain.error_of_smooth, domain.error_of_edged, domain.within) == (found.smooth, found.edged, found.within)
    assert "The model is scalar" in (bundle / "README.md").read_text(encoding="utf-8")


def test_the_licence_is_stated(bake: Baker, tmp_path: Path) -> None:
    config = small(publish={"licence": "CC-BY-4.0"})
    folder = publish(config, bake(config), tmp_path)
    assert manifest_of(folder).licence == "CC-BY-4.0"
    assert "CC-BY-4.0" in (folder / "README.md").read_text(encoding="utf-8")


def test_nothing_of_this_machine_or_moment_is_inside(
    bake: Baker, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(platform, "node", lambda: "this-very-host")
    monkeypatch.setattr(socket, "gethostname", lambda: "this-very-host")
    inputs = bake(small())
    bundle = publish(small(), inputs, tmp_path)
    folders = [str(tmp_path), str(inputs["table"].folder.parents[1]), str(Path(__file__).parents[2])]
    for name in ("manifest.json", "README.md", "SHA256SUMS", "evaluate.py"):
        text = (bundle / name).read_text(encoding="utf-8")
        assert not [folder for folder in folders if folder in text]
        assert "this-very-host" not in text
        assert not re.search(r"\d{4}-\d\d-\d\d|\d\d:\d\d|seconds", text)


def test_files_of_a_config_are_stated_by_name_and_digest(bake: Baker, tmp_path: Path) -> None:
    light = tmp_path / "lamp.csv"
    light.write_text("lambda_nm,power\n360,1\n830,2\n", encoding="utf-8")
    config = small(spectrum={"illuminant": str(light)})
    text = (publish(config, bake(config), tmp_path) / "manifest.json").read_text(encoding="utf-8")
    illuminant = json.loads(text)["provenance"]["config"]["spectrum"]["illuminant"]
    assert illuminant["file"] == "lamp.csv"
    assert len(illuminant["sha256"]) == 64
    assert str(tmp_path) not in text


def test_the_same_content_twice_is_one_bundle(bake: Baker, bundle: Path) -> None:
    before = {path: path.stat().st_mtime_ns for path in bundle.rglob("*")}
    assert publish(small(), bake(small()), bundle.parent) == bundle
    assert {path: path.stat().st_mtime_ns for path in bundle.rglob("*")} == before
    assert [path.name for path in bundle.parent.iterdir()] == [bundle.name]


def test_other_content_is_another_bundle(bake: Baker, bundle: Path) -> None:
    config = small(material={"ior": 1.4})
    other = publish(config, bake(config), bundle.parent)
    assert other != bundle
    assert verify(bundle) == verify(other) == []


def test_a_damaged_folder_is_neither_used_nor_repaired(bake: Baker, tmp_path: Path) -> None:
    folder = publish(small(), bake(small()), tmp_path)
    (folder / "README.md").write_text("changed", encoding="utf-8")
    with pytest.raises(DamagedError, match=r"README\.md was changed.*Move it away"):
        publish(small(), bake(small()), tmp_path)
    assert (folder / "README.md").read_text(encoding="utf-8") == "changed"
    assert [path.name for path in tmp_path.iterdir()] == [folder.name]


def test_an_interrupted_publication_leaves_no_files(
    bake: Baker, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupted(path: Path, _pixels: object) -> None:
        if path.name == "I_03.exr":
            raise KeyboardInterrupt
        path.touch()

    monkeypatch.setattr(images, "write_rgba", interrupted)
    with pytest.raises(KeyboardInterrupt):
        publish(small(), bake(small()), tmp_path)
    assert list(tmp_path.iterdir()) == []


def test_a_folder_that_cannot_be_written_is_an_error(bake: Baker, tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(StorageError, match="cannot be written"):
        publish(small(), bake(small()), tmp_path / "file" / "out")


def test_an_exr_that_cannot_be_written_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(StorageError, match="disk full"):
        images.write_rgba(tmp_path / "none" / "a.exr", np.zeros((2, 2, 4), np.float32))


def test_every_user_may_read_a_bundle(bundle: Path) -> None:
    umask = os.umask(0)
    os.umask(umask)
    assert stat.S_IMODE(bundle.stat().st_mode) == 0o777 & ~umask


def test_a_scene_skips_texels(bake: Baker, tmp_path: Path) -> None:
    config = small(scene=SCENE, render={"lights": SCENE["lights"]})
    manifest = manifest_of(publish(config, bake(config), tmp_path))
    assert manifest.coverage.skipped_share > 0.3
    assert manifest.provenance.config["scene"]["views"]["theta_max_deg"] == 45.0


# phrases that hold in one normalisation only
TEXT = {
    "absolute": ("1/sr", "normalisation absolute", "Y = colour.mirror_y"),
    "relative": ("normalisation relative", "eq. 4", "Y = 1", "are in RU", "path tracer"),
}


@pytest.mark.parametrize("layout", ["taylor", "polar"])
@pytest.mark.parametrize(("held", "other"), [("absolute", "relative"), ("relative", "absolute")])
def test_no_text_of_one_normalisation_stands_in_a_bundle_of_the_other(
    bake: Baker, tmp_path: Path, layout: str, held: str, other: str
) -> None:
    config = small(layout, material={"normalisation": held})
    folder = publish(config, bake(config), tmp_path)
    names = ("README.md", "manifest.json", "evaluate.py")
    texts = {name: (folder / name).read_text(encoding="utf-8") for name in names}
    for name, text in texts.items():
        assert f"normalisation {held}" in text, name
        assert not [phrase for phrase in TEXT[other] if phrase in text], name
        assert "at 1 RU)" not in text
        assert "under 1 RU" not in text
    stated = manifest_of(folder).colour
    assert stated.normalisation == held
    assert f"`mirror_y` is {stated.mirror_y:.6g}" in texts["README.md"]
    assert stated.mirror_y == pytest.approx(config.radiometry.unit)
    assert (stated.mirror_y > 2.0) == (held == "absolute")


def test_the_picture_of_a_map_can_be_made_from_its_numbers(bake: Baker, tmp_path: Path) -> None:
    """PNG = sRGB(XYZ exposure / mirror_y), to a rounding, with the chunks that say so."""
    folder = publish(small(), bake(small()), tmp_path)
    manifest = manifest_of(folder)
    entry = manifest.maps[0]
    xyz = images.read_xyz(folder / entry.file).astype(float) / manifest.colour.mirror_y
    with Image.open(folder / entry.png) as picture:
        found = np.asarray(picture).astype(int)
        assert picture.info["srgb"] == 0
        assert picture.info["gamma"] == pytest.approx(0.45455)
        assert picture.info["chromaticity"][:2] == pytest.approx((0.3127, 0.329))
    assert found.max() > 0
    assert np.abs(found - colour.pixels(xyz, entry.exposure_ru)).max() <= 1
