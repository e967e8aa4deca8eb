"""Traces, and other tasks, on the workers of a Dask cluster."""
