"""The entries of the manifest."""

from importlib.resources import files
from typing import Annotated, Literal

from pydantic import Field

from pipeline.bundle.layout import BundleLayout, GridEntry, StorageLoss, TableImage


class NearestImage(TableImage):
    layout: Literal["nearest"]
    scale: Literal[1]


class NearestGridEntry(GridEntry):
    layout: Literal["nearest"]
    width: Annotated[int, Field(ge=3, le=201)]
    height: Annotated[int, Field(ge=3, le=201)]

    def contradictions(self, images, _scene):
        return [f"grid: expected 1 image, got {images}"] if images != 1 else []


class NearestLoss(StorageLoss):
    layout: Literal["nearest"]


LAYOUT = BundleLayout(
    image=NearestImage,
    grid=NearestGridEntry,
    loss=NearestLoss,
    shader=files(__package__).joinpath("nearest.glsl"),
)
