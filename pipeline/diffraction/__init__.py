"""Expansion, DFT stack, power spectrum and the exact reference."""
