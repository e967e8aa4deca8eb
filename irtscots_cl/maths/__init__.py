"""Frames, quadrics, Zernike polynomials, slopes to heights, error bars."""
