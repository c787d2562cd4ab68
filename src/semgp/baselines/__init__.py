"""The rivals: simple maps that are hard to beat."""
