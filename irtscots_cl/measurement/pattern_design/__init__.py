"""Which patterns suit a test: the height error of each set, before any image exists."""
