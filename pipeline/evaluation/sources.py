"""The works that methods and figures are taken from, by the tags of docs/references.md, and their normalisation."""

from pipeline.config.models import Config

SOURCES = {
    "[D14]": "Dhillon et al., Interactive Diffraction from Biological Nanostructures, 2014",
    "[S14]": "Single, An Interactive Shader for Natural Diffraction Gratings, 2014",
    "[S99]": "Stam, Diffraction Shaders, 1999",
    "[G04]": "Stam, Simulating Diffraction, 2004",
}


def as_published(config: Config) -> Config:
    """Returns a config in the normalisation of [D14] eq. 4, so that its colours compare with the published ones."""
    return config.model_copy(update={"material": config.material.model_copy(update={"normalisation": "relative"})})
