"""Defaults of a trace that the command line has, too; without NumPy."""

RAYS_PER_PIXEL = 16384  # of a detector pixel (adjoint) or of a screen pixel (forward, nonsequential)
