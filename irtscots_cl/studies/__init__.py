"""The paper's tables and figures again, one module each: `irtscots reproduce` runs them.

A study is a module with a TITLE and a function `study(lab)` that returns a verdicts.Outcome. It stands on the public
API; what several studies trace is traced once. docs/studies.md says how to add one.
"""
