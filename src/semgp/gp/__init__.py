"""Gaussian-process classification: pure functions in the symbols of Rasmussen & Williams."""
