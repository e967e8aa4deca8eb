"""How fast rays are traced, how the time grows with a job, and which error is had for which time."""
