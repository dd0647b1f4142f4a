"""The table stage of either layout: one name, one place in the order."""

from pipeline.config.models import Config
from pipeline.stages import polar_table, taylor_table
from pipeline.stages.stage import Stage
from pipeline.store.store import Artifact
from pipeline.tables.polar.layout import PolarLayout
from pipeline.tables.polar.table import PolarTable
from pipeline.tables.taylor.table import TaylorTable


def stage_of(config: Config) -> Stage:
    """The table stage that a config's layout asks for."""
    return polar_table.TABLE if isinstance(config.table, PolarLayout) else taylor_table.TABLE


def load(config: Config, artifact: Artifact) -> PolarTable | TaylorTable:
    """The table of a table artifact made for this config."""
    return polar_table.load(artifact) if isinstance(config.table, PolarLayout) else taylor_table.load(artifact)


def size_of(config: Config) -> str:
    """How large a table will be, in words."""
    section = config.table
    if isinstance(section, PolarLayout):
        return f"{section.rings} rings x {section.azimuths} azimuths"
    return f"{section.resolution}² nodes x {section.step_nm:g} nm steps"
