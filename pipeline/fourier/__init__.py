"""Discrete Fourier transforms by FFTW. No other part of the project imports pyFFTW.

- `term_transforms.py`: the transforms of a series' terms at the coefficients that are kept, planned by measurement.
- `wisdom.py`: saves those plans for later processes.
- `backend.py`: single transforms for recipes, by `scipy.fft` with FFTW as its backend.
"""
