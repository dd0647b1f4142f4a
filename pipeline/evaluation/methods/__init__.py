"""Every way of the literature from a height field to diffraction's colour, behind one interface."""
