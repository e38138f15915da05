"""Interventions: changes of a run from outside, as data; one module for each subject."""
