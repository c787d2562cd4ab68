"""Semantic OctoMap: occupancy by ray casting, averaged labels and colour in each voxel."""
