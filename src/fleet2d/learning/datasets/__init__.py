"""Data sets: labelled evidence of many homes and people, for learning, and the models learned.

Public are `fleet2d.dataset` and `fleet2d.open_dataset`; see docs/how-to/datasets.md.
"""
