"""Fitting: personas learned from logs, and how well they match days that they weren't fitted on."""
