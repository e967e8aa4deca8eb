"""What the host offers: memory, whole files, versions."""
