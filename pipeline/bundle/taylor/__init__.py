"""The paper's tables in bundles: an image for each I_p, their storage and their look-up."""
