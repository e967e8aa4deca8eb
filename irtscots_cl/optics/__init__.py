"""Rays in float64 on the host: surfaces, chief rays, a pixel's light in closed form."""
