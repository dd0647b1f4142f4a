"""Which module knows what a bundle says of a table."""

from collections.abc import Mapping

from pipeline.bundle import polar, taylor
from pipeline.bundle.prepared import Prepared
from pipeline.config.models import Config
from pipeline.store.store import Artifact
from pipeline.tables.polar.layout import PolarLayout


def prepare(config: Config, inputs: Mapping[str, Artifact]) -> Prepared:
    """A table's part of a bundle. Raises AccuracyError where what is to be stored would not keep its digits."""
    layout = polar.prepare if isinstance(config.table, PolarLayout) else taylor.prepare
    return layout(config, inputs)
