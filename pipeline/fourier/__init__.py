"""Discrete Fourier transforms by FFTW. No other part of the project imports pyFFTW.

- `term_transforms.py`: the transforms of a series' terms, planned by measurement, of the frequencies kept alone.
- `wisdom.py`: those plans, kept from process to process.
- `backend.py`: single transforms, for statistics and recipes, by `scipy.fft` with FFTW behind it.
"""
