"""`bench scene`: what a scene saves of a bake, and that it changes no value."""
