"""Studies: many scenarios run as one experiment, resumable, ending in an answer.

Public are `fleet2d.study`, `fleet2d.open_study` and `fleet2d.map_runs`; see docs/how-to/studies.md.
"""
