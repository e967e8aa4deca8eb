"""The paper's tables and figures again, a small module for each: `irtscots reproduce` runs them.

A study is a module with a TITLE and a function `study(lab)` that returns an outcome.Outcome. It stands on the public
API; what several studies trace, the lab traces once. docs/studies.md tells how to write one.
"""
