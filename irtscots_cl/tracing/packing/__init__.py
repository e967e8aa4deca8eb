"""A scene's numbers as the kernels' structures."""
