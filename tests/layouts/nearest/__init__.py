"""A third layout, "nearest": |P|^2 at the largest |w| of even nodes of (u, v), without interpolation."""
