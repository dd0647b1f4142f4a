"""Settings of all tests."""

import pytest
from hypothesis import settings

# the same examples every time, so that no submission fails by luck; --hypothesis-profile=explore looks further
settings.register_profile("steady", derandomize=True, deadline=None)
settings.register_profile("explore", deadline=None)
settings.load_profile("steady")

# folders whose tests hold laws and closed forms; single modules of other folders set the marker themselves
_PHYSICS = {"accuracy", "diffraction", "methods", "optics", "tables"}


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    for item in items:
        if item.path.parent.name in _PHYSICS:
            item.add_marker("physics")
    # so that no worker of pytest-xdist begins one while the other has nothing left to do
    items.sort(key=lambda item: item.get_closest_marker("long") is None)
