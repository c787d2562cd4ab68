"""Readers: one file per format, one registry."""
