"""Reflectance of interfaces: limits every textbook gives, and an independent formula for metals."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.errors import InputError
from pipeline.optics import fresnel

cosines = st.floats(0.0, 1.0)
dielectrics = st.floats(1.01, 5.0)
# from silver's 0.05 to silicon's 4; n and k as metals have them in visible light
# (n = 1, k = 0 is no interface: at grazing 0/0)
metals = st.tuples(st.floats(0.04, 5.0), st.floats(1e-3, 10.0)).map(lambda nk: complex(*nk))


@given(ior=dielectrics)
def test_normal_incidence(ior):
    """((n - 1) / (n + 1))^2, for the exact formula as for Schlick's."""
    expected = ((ior - 1.0) / (ior + 1.0)) ** 2
    assert fresnel.reflectance(1.0, ior) == pytest.approx(expected, rel=1e-12)
    assert fresnel.schlick(1.0, ior) == pytest.approx(expected, rel=1e-12)


@given(ior=dielectrics)
def test_brewster(ior):
    """At tan t = n the p wave vanishes; the s wave's amplitude there is (n^2 - 1) / (n^2 + 1)."""
    brewster = np.cos(np.arctan(ior))
    expected = 0.5 * ((ior**2 - 1.0) / (ior**2 + 1.0)) ** 2
    assert fresnel.reflectance(brewster, ior) == pytest.approx(expected, rel=1e-10)


@given(index=metals)
def test_grazing_light_is_reflected_whole(index):
    """At 90 degrees every interface is a mirror."""
    assert fresnel.reflectance(0.0, index) == pytest.approx(1.0, abs=1e-12)


@given(cos_theta=cosines, index=metals)
def test_metal_by_its_real_and_imaginary_parts(cos_theta, index):
    """Born & Wolf write the metal with real numbers only: n cos t = a + ib, and R_s, R_p from a, b."""
    n2, k2, sin2 = index.real**2, index.imag**2, 1.0 - cos_theta**2
    t0 = n2 - k2 - sin2
    modulus = np.hypot(t0, 2.0 * index.real * index.imag)
    a = np.sqrt(np.maximum(0.5 * (modulus + t0), 0.0))
    outer, inner = modulus + cos_theta**2, 2.0 * cos_theta * a
    r_s = (outer - inner) / (outer + inner)
    outer, inner = cos_theta**2 * modulus + sin2**2, inner * sin2
    r_p = r_s * (outer - inner) / (outer + inner) if outer + inner > 0 else 1.0
    # half of modulus + t0 cancels where the metal hardly refracts, a root of which enters
    assert fresnel.reflectance(cos_theta, index) == pytest.approx(0.5 * (r_s + r_p), abs=1e-6)


@given(cos_theta=cosines, index=metals)
def test_no_interface_reflects_more_than_it_receives(cos_theta, index):
    """0 <= R <= 1, to rounding."""
    assert -1e-12 <= fresnel.reflectance(cos_theta, index) <= 1.0 + 1e-12


@given(a=cosines, b=cosines, ior=dielectrics)
def test_schlick_falls_from_1_to_f0(a, b, ior):
    """Schlick's term is 1 at grazing, F0 at normal incidence and falls between."""
    assert fresnel.schlick(0.0, ior) == pytest.approx(1.0, rel=1e-15)
    low, high = sorted((a, b))
    assert fresnel.schlick(low, ior) >= fresnel.schlick(high, ior) >= fresnel.schlick(1.0, ior)


def test_schlick_stays_near_the_exact_curve():
    """For glass Schlick's fit stays within 0.05 of Fresnel's curve at all angles."""
    cosine = np.linspace(0.0, 1.0, 200)
    assert np.max(np.abs(fresnel.schlick(cosine, 1.5) - fresnel.reflectance(cosine, 1.5))) < 0.05


def test_gold_is_gold():
    """Gold reflects more than 90 % of red light and less than half of the blue."""
    red, blue = fresnel.reflectance(1.0, fresnel.metal_index("Au", np.array([650.0, 450.0])))
    assert red > 0.9
    assert blue < 0.5


def write(folder, text):
    path = folder / "metal.csv"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return str(path)


@pytest.mark.parametrize(
    "text",
    [
        "lambda_nm,n,k\n400,1,2\n500,3,6\n",
        "# measured\n\n400; 1; 2 # here\n500; 3; 6",
        "\ufeff400,1,2\r\n500,3,6\r\n",
    ],
    ids=["header", "comments and semicolons", "byte order mark"],
)
def test_csv_is_read_linearly_between_samples(tmp_path, text):
    """A quarter of the way between two samples n and k have gone a quarter of theirs."""
    index = fresnel.metal_index(write(tmp_path, text), np.array([400.0, 425.0, 500.0]))
    np.testing.assert_allclose(index, [1 + 2j, 1.5 + 3j, 3 + 6j], rtol=1e-14)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("lambda,n,k\n400,1,2\n500,3\n", "line 3: expected 3 finite numbers, got '500,3'"),
        ("400,1,2\n500,3,x\n", "line 2: expected 3 numbers, got '500,3,x'"),
        ("lambda,n,k\n400,one,2\n500,3,6\n600,3,6\n", "line 2: expected 3 numbers, got '400,one,2'"),
        ("400,1,2\n500,nan,6\n", "line 2: expected 3 finite numbers"),
        ("400,1,2\n500,3,inf\n", "line 2: expected 3 finite numbers"),
        ("500,1,2\n400,3,6\n", "ascending"),
        ("400,1,2\n400,3,6\n", "ascending"),
        ("400,1,2\n", "at least two rows"),
        ("", "at least two rows"),
        ("lambda,n,k\n", "at least two rows"),
        (b"\x89PNG\r\n\x1a\n\xff\xfe", "UTF-8"),
    ],
)
def test_bad_csv_names_the_file_and_the_line(tmp_path, text, said):
    """The error names the line of the CSV that does not fit, and its content."""
    path = write(tmp_path, text)
    with pytest.raises(InputError) as error:
        fresnel.metal_index(path, np.array([400.0]))
    assert path in str(error.value)
    assert said in str(error.value)


@pytest.mark.parametrize("lambda_nm", [399.0, 501.0])
def test_indices_are_not_extrapolated(tmp_path, lambda_nm):
    """Beyond its samples nothing is known of a metal."""
    path = write(tmp_path, "400,1,2\n500,3,6\n")
    with pytest.raises(InputError, match=r"400\.\.500 nm"):
        fresnel.metal_index(path, np.array([450.0, lambda_nm]))


@pytest.mark.parametrize("row", ["-1,3", "0,3", "1.5,-3", "1,0"])
def test_indices_of_no_metal_are_refused(tmp_path, row):
    """n <= 0 and k < 0 have no meaning here; n = 1 with k = 0 reflects nothing and would divide by zero."""
    path = tmp_path / "odd.csv"
    path.write_text(f"lambda_nm,n,k\n300,{row}\n900,{row}\n")
    with pytest.raises(InputError, match="n > 0 and k >= 0"):
        fresnel.metal_index(str(path), np.array([500.0]))
