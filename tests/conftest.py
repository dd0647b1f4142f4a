"""Settings of all tests."""

from hypothesis import settings

# the same examples every time, so that no submission fails by luck; --hypothesis-profile=explore looks further
settings.register_profile("steady", derandomize=True, deadline=None)
settings.register_profile("explore", deadline=None)
settings.load_profile("steady")
