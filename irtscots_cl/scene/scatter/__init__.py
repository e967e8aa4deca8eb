"""Scatter of optical surfaces: lobes, their models, their tables in a scene file."""
