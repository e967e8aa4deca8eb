"""Numerical stability on hard cases: the device's arithmetic, ray by ray, against exact references.

checks: the findings of a case and their limits. exact: mirror and devices at 50 digits. The other files contain the
cases, one topic each; suite runs them all. Single rays on a device come from tracing/checks/probes.py.
"""
