"""What will be looked at: lights, views, cameras and meshes, as pairs of directions in the sample's own frame."""
