"""The works that methods and figures are taken from, by the tags of docs/references.md."""

SOURCES = {
    "[D14]": "Dhillon et al., Interactive Diffraction from Biological Nanostructures, 2014",
    "[S14]": "Single, An Interactive Shader for Natural Diffraction Gratings, 2014",
    "[S99]": "Stam, Diffraction Shaders, 1999",
    "[G04]": "Stam, Simulating Diffraction, 2004",
}
