"""The block map's machinery: sites, blocks of them, and the closed-form posteriors on each block."""
