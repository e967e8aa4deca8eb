"""SIMULATION: scene and device to light transport, by four estimators."""
