"""A detector pixel's light in closed form."""
