"""Fast lengths against scipy's."""

from scipy.fft import next_fast_len

from pipeline.fourier.lengths import next_fast


def test_lengths_are_scipys() -> None:
    assert [next_fast(n) for n in range(1, 20_000)] == [next_fast_len(n, real=True) for n in range(1, 20_000)]
