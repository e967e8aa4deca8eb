"""Rays of the device against float64, and whether its precision suffices."""
