"""Where launches run: one device, many, a Dask cluster; checkpoints. Knows no scene."""
