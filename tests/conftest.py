"""Settings of all tests."""

from hypothesis import settings

# the same examples every time: a submission must not fail by another's bad luck; explore with --hypothesis-profile=explore
settings.register_profile("steady", derandomize=True, deadline=None)
settings.register_profile("explore", deadline=None)
settings.load_profile("steady")
