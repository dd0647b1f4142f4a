"""The whole span of surfaces, windows and directions, cell by cell: digits, or a refusal, and never a silent error.

Every cell (`cell.py`) is one surface seen one way, held against `power_direct`, the plain sum over samples:

- series (`series_way.py`): a DFT stack summed in memory, in its own precision; Taylor or Chebyshev, float32 or
  float64;
- device (`device_ways.py`): what the stages run: `Reference` (Chebyshev float64), E of the polar power spectrum at
  its own nodes (Chebyshev float32), the paper's I_p kept in float32 (Taylor float32);
- table (`table_way.py`): a polar table baked by the stages, certificate included, on directions that the
  certificate never saw.

Errors of |P|^2 are |found - truth| / max(truth, floor) (`reading.py`). In speckle every relative error diverges at
the dark nodes, so the floor is part of what each way promises (`judging.py`). The one that says most is a thousandth
of the surface's mean level: by Parseval the mean of |P|^2 over the scan's band is sum g^2 / (sum g)^2, whatever the
heights. `sweep.py` has the families of cells.
"""
