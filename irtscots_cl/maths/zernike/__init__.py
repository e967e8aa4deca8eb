"""Zernike polynomials on the unit disk."""
