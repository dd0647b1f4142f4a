"""Light and observer as quadratures: whites, spectral colours and what a rule of n nodes may miss."""

import subprocess
import sys

import colour
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.errors import InputError
from pipeline.optics import light
from pipeline.optics.light import LaserLine, Light, illuminant_at, observer_at, trapezoid

OBSERVER = "CIE 1931 2 Degree Standard Observer"
ILLUMINANTS = ["D65", "A", "E", "FL2", LaserLine(lambda_nm=532.0)]


def chromaticity(quadrature):
    white = quadrature.weights.sum(axis=0)
    return white[:2] / white.sum()


@pytest.mark.parametrize("illuminant", ILLUMINANTS, ids=str)
@pytest.mark.parametrize("step_nm", [1.0, 5.0, 7.3])
def test_white_mirror_has_luminance_1(illuminant, step_nm):
    """|P|^2 = 1 at all wavelengths gives Y = 1, whatever the light and the step."""
    weights = trapezoid(Light(illuminant=illuminant), step_nm).weights
    assert weights[:, 1].sum() == pytest.approx(1.0, rel=1e-14)


@pytest.mark.parametrize("step_nm", [1.0, 5.0])
@pytest.mark.parametrize("name", ["D65", "A", "E"])
def test_white_has_the_illuminants_published_chromaticity(name, step_nm):
    """CIE 15's (x, y) for the illuminant, within the 1e-3 that 380 .. 780 nm leaves."""
    found = chromaticity(trapezoid(Light(illuminant=name), step_nm))
    np.testing.assert_allclose(found, colour.CCS_ILLUMINANTS[OBSERVER][name], atol=1e-3)


@pytest.mark.parametrize("name", ["D65", "A"])
def test_white_agrees_with_colour_science(name):
    """colour-science's own integral of the illuminant over the same range, at 1 nm."""
    shape = colour.SpectralShape(380, 780, 1)
    power = colour.SDS_ILLUMINANTS[name].copy().align(shape)
    xyz = colour.sd_to_XYZ(power, colour.MSDS_CMFS[OBSERVER].copy().align(shape), method="Integration")
    found = chromaticity(trapezoid(Light(illuminant=name), 1.0))
    np.testing.assert_allclose(found, colour.XYZ_to_xy(xyz), atol=1e-3)


@given(st.floats(400.0, 700.0))
def test_laser_line_lies_on_the_spectral_locus(lambda_nm):
    """One wavelength is one node, coloured as the matching functions are there."""
    spectrum = Light(illuminant=LaserLine(lambda_nm=lambda_nm))
    line = trapezoid(spectrum, 5.0)
    matching = observer_at(OBSERVER, np.array([lambda_nm]))[0]
    assert line.lambda_nm.tolist() == [lambda_nm]
    np.testing.assert_allclose(chromaticity(line), matching[:2] / matching.sum(), rtol=1e-12)
    assert spectrum.lambda_min_nm == line.lambda_min_nm == lambda_nm


@given(step_nm=st.floats(0.5, 500.0), low=st.floats(360.0, 500.0), width=st.floats(10.0, 300.0))
def test_any_step_covers_the_range_evenly(step_nm, low, width):
    """The nodes run from end to end, equally spaced and no further apart than asked."""
    nodes = trapezoid(Light(illuminant="E", range_nm=(low, low + width)), step_nm).lambda_nm
    gaps = np.diff(nodes)
    assert (nodes[0], nodes[-1]) == (low, low + width)
    assert np.all(gaps <= step_nm * (1.0 + 1e-8))
    np.testing.assert_allclose(gaps, gaps[0], rtol=1e-9)
    assert len(gaps) == 1 or gaps[0] * len(gaps) > step_nm * (len(gaps) - 1) * (1.0 - 1e-8)


def test_trapezoid_halves_the_ends():
    """The rule of [D14] under equal energy: inner nodes weigh the observer, the two ends half of it."""
    quadrature = trapezoid(Light(illuminant="E", range_nm=(500.0, 600.0)), 25.0)
    matching = observer_at(OBSERVER, quadrature.lambda_nm)
    shares = quadrature.weights / matching
    np.testing.assert_allclose(shares / shares[2], np.array([0.5, 1, 1, 1, 0.5])[:, None] * np.ones(3), rtol=1e-12)


def test_csv_of_constant_power_is_equal_energy(tmp_path):
    """Two samples of the same power, at any scale, are illuminant E."""
    path = tmp_path / "flat.csv"
    path.write_text("lambda_nm,power\n380,7\n780,7\n")
    found = trapezoid(Light(illuminant=str(path)), 5.0)
    np.testing.assert_allclose(found.weights, trapezoid(Light(illuminant="E"), 5.0).weights, rtol=1e-13)


def test_csv_is_linear_between_its_samples(tmp_path):
    """Power goes straight from sample to sample; only its shape counts, so its largest value is 1."""
    path = tmp_path / "ramp.csv"
    path.write_text("400,0\n500,10\n700,0\n")
    found = illuminant_at(str(path), np.array([400.0, 425.0, 500.0, 600.0]))
    np.testing.assert_allclose(found, [0.0, 0.25, 1.0, 0.5], atol=1e-13)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("400,1\n780,1\n", "400..780 nm"),
        ("380,1\n700,1\n", "380..700 nm"),
        ("380,1\n500,-1\n780,1\n", "power >= 0"),
        ("380,0\n780,0\n", "power >= 0"),
        ("380,1,1\n780,1,1\n", "line 1: expected 2"),
        (b"\xff\xfe\x00", "UTF-8"),
    ],
)
def test_csv_that_is_no_illuminant_is_refused(tmp_path, text, said):
    """A light must have some power, nowhere less than none, over the whole range asked for."""
    path = tmp_path / "light.csv"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    with pytest.raises(InputError) as error:
        trapezoid(Light(illuminant=str(path)), 5.0)
    assert said in str(error.value)
    assert str(path) in str(error.value)


def test_named_illuminant_that_ends_early_is_refused():
    """ISO 7589's lights end before 780 nm: what lies beyond is not made up."""
    with pytest.raises(InputError, match=r"350\.\.690 nm"):
        trapezoid(Light(illuminant="ISO 7589 Studio Tungsten"), 5.0)


def test_observer_that_begins_late_is_refused():
    """The observers of 2015 begin at 390 nm; their last value is not carried on to 380."""
    spectrum = Light(illuminant="E", observer="CIE 2015 2 Degree Standard Observer")
    with pytest.raises(InputError, match=r"390\.\.830 nm, but 380\.\.780"):
        trapezoid(spectrum, 5.0)
    within = trapezoid(spectrum.model_copy(update={"range_nm": (390.0, 780.0)}), 5.0)
    assert within.weights[:, 1].sum() == pytest.approx(1.0, rel=1e-14)


@pytest.mark.parametrize("name", ["A", "C", "D50", "D55", "D65", "D75", "FL2"])
def test_illuminants_are_the_librarys(name):
    """Shipped or not, every number is colour-science's."""
    nodes, power = light.illuminant_samples(name)
    np.testing.assert_array_equal(nodes, colour.SDS_ILLUMINANTS[name].wavelengths)
    np.testing.assert_array_equal(power, colour.SDS_ILLUMINANTS[name].values)


@pytest.mark.parametrize(
    "name", [OBSERVER, "CIE 1964 10 Degree Standard Observer", "CIE 2015 2 Degree Standard Observer"]
)
def test_observers_are_the_librarys(name):
    """Shipped or not, every number is colour-science's."""
    nodes, values = light.observer_samples(name)
    np.testing.assert_array_equal(nodes, colour.MSDS_CMFS[name].wavelengths)
    np.testing.assert_array_equal(values, colour.MSDS_CMFS[name].values)


def test_common_lights_do_not_import_colour_science():
    """The import takes longer than a table."""
    script = "import sys, pipeline.optics.light as light; light.trapezoid(light.Light(), 1.0); print(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    loaded = done.stdout.split()
    assert "pipeline.optics.light" in loaded
    assert "colour" not in loaded
