"""The ready-made jobs: simulate, measure, reach a target."""
