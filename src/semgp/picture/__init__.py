"""Pictures without display or GPU."""
