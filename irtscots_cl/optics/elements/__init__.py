"""The elements of a scene in float64: components, media, sequential rays, focus."""
