"""Maps: thin, stateful, one protocol for all."""
