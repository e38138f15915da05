"""Interventions: all that somebody does to a run from outside, as data; one module a subject."""
