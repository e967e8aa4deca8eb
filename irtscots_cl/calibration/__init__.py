"""What is not known about a test's geometry, and what its images say about it."""
