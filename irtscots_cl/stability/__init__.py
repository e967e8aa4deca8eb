"""Numerical stability on hard cases: the device's arithmetic, ray by ray, against exact references.

checks: what a case found and its bound. exact: mirror and devices at 50 digits. probes: single rays on a device.
The other files hold the cases, one concern each; run puts them together.
"""
