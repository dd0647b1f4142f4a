"""Run time against error of every way to the same pictures, measured in one run on one machine.

`suite.py` runs them on a surface: the paper's tables (`paper.py`), the polar table (`polar_bake.py`), the same table
by FINUFFT (`nufft.py`) and by plain numpy (`plain.py`), each with its error on the map (`truth.py`); and the stack's
transforms by the kernel, FFTW and scipy (`transforms.py`). `constants.py` times what each constant of the kernels
buys, `compiling.py` what a new machine waits for, by whole runs (`processes.py`). `machine.py` measures what the
device can do at most, `work.py` counts what the stages need, `memory.py` what a bake holds. `criteria.py` holds all
against what was promised; `files.py` writes them down.
"""

from pipeline.evaluation.speed.plain import paper_nodes as plain_numpy

__all__ = ["plain_numpy"]
