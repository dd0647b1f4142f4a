"""Run time against error of every algorithm that makes the same pictures, measured in one run on one machine.

`suite.py` measures a surface: the paper's tables (`paper.py`), the polar table (`polar_bake.py`), the same table by
FINUFFT (`nufft.py`) and by plain numpy (`plain_numpy.py` above), each with the error of its map (`truth.py`), and the
stack's transforms by the kernel, FFTW and scipy (`transforms.py`). `constants.py` times the constants of the kernels,
`processes.py` whole runs and compiling, `memory.py` the memory of a bake, `stage_costs.py` seconds and memory of each
stage, and `growth.py` these over the size of a scan. `machine.py` measures the limits of the device, `work.py` counts
the operations of the stages. `checks.py` states the criteria; `bench.py` runs all.
"""
