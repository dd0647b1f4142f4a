"""The cost of several configs that share a surface."""

import sys

import pytest

from pipeline.evaluation.speed import batch

# of this project's own default size; smaller surfaces spend their time on starting processes and writing files
_SURFACE = """\
[surface]
recipe = { kind = "elaphe", across_um = 1.144, height_um = 0.37, seed = 1 }
[render]
lights = [{ theta_deg = 0 }, { theta_deg = 30, phi_deg = 180 }]
"""


@pytest.mark.slow
@pytest.mark.alone
def test_ten_configs_of_one_surface_cost_little_more_than_twice_one(capsys: pytest.CaptureFixture[str]) -> None:
    """At most 2.5 times on a quiet machine; the bound leaves room for others on its cores."""
    cost = batch.measure([sys.executable, "-c", "from cli.entry import process; process()"], _SURFACE)
    with capsys.disabled():
        print(
            f"\n{cost.configs} configs: {cost.all.seconds:.1f} s against {cost.one.seconds:.1f} s, {cost.ratio:.2f} "
            f"times; of processor time {cost.cpu_ratio:.2f} times"
        )
    assert cost.configs == 10
    assert cost.cpu_ratio <= 3.5
