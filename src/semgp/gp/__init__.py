"""Gaussian-process classification as pure functions on arrays, in the symbols of the paper and of Rasmussen & Williams."""
