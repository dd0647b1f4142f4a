"""Digests: the same content always has the same one, any other content another."""

import hashlib
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.store import digest

json_values = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False, allow_infinity=False) | st.text(),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=4), inner, max_size=3),
    max_leaves=10,
)


@given(st.dictionaries(st.text(max_size=4), json_values, max_size=5))
def test_order_of_keys_does_not_matter(value):
    """The order of a config's sections makes no difference."""
    assert digest.of_json(value) == digest.of_json(dict(reversed(value.items())))


@given(a=json_values, b=json_values)
def test_other_content_has_another_digest(a, b):
    """Two values share a digest only if they are the same, types included (1 is not true, "1" not 1)."""
    assert (digest.of_json(a) == digest.of_json(b)) == (_typed(a) == _typed(b))


def _typed(value):
    """A value with its types, free of the order of keys."""
    if isinstance(value, dict):
        return ("dict", sorted((key, _typed(inner)) for key, inner in value.items()))
    if isinstance(value, list):
        return ("list", [_typed(inner) for inner in value])
    return (type(value).__name__, repr(value))


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_values_that_json_lacks_are_refused(value):
    """NaN is not even equal to itself: nothing can be addressed by it."""
    with pytest.raises(ValueError, match="JSON"):
        digest.of_json({"a": [value]})


@given(st.binary(max_size=300))
def test_a_files_digest_is_of_its_bytes(tmp_path_factory, data):
    """SHA-256 of the content; name and time do not enter."""
    path = tmp_path_factory.getbasetemp() / "file"
    path.write_bytes(data)
    assert digest.of_file(path) == hashlib.sha256(data).hexdigest()


def test_a_folders_digest_lists_every_file_below(tmp_path):
    """Relative paths with forward slashes, hidden and empty files included, folders not."""
    for name in ("b", "deep/er/c", ".hidden"):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_bytes(name.encode())
    (tmp_path / "empty").touch()
    (tmp_path / "hollow").mkdir()
    found = digest.of_folder(tmp_path)
    assert set(found) == {"b", "deep/er/c", ".hidden", "empty"}
    assert found["deep/er/c"] == {"bytes": 9, "sha256": hashlib.sha256(b"deep/er/c").hexdigest()}
    assert found["empty"]["bytes"] == 0
