"""Numerical stress test of |P|^2: each test case meets its tolerance or is refused; no error is silent.

A case (`sweep.py`) is one surface, window and algorithm (`algorithms.py`), compared with `power_direct`, the plain
sum over samples:

- "series": a DFT stack summed in memory in its own precision; Taylor or Chebyshev, float32 or float64;
- "device": what the stages run: `Reference` (Chebyshev float64), the polar power spectrum E at its own nodes
  (Chebyshev float32), the paper's I_p kept in float32 (Taylor float32);
- "table": a polar table baked by the stages, certificate included, on directions that the certificate never saw.

Errors of |P|^2 are |found - truth| / max(truth, floor). In speckle every relative error diverges at the dark nodes,
so the floor is a part of each tolerance (`verdict.py`). The most telling floor is a thousandth of the surface's mean
level: by Parseval the mean of |P|^2 over the frequencies below Nyquist is sum g^2 / (sum g)^2, whatever the heights.
`sweep.py` lists the families of cases; `bench.py` runs them and writes the results.
"""
