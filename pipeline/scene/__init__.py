"""Lights, views, cameras and meshes of a scene, as pairs of directions in the sample's own frame."""
