"""Continuous semantic maps by Gaussian processes."""
