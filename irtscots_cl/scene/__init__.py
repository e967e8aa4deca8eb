"""What is tested and with what: frozen, checked, as TOML. No NumPy at import."""
