"""The paper's tables and figures again, one module each: `irtscots reproduce` runs them.

A study is a module with a TITLE and a function `study(traces)` that returns a verdicts.StudyResult. It uses the public
API; traces that several studies need are made once. docs/studies.md says how to add a study.
"""
