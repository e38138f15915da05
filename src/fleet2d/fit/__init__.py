"""Fitting: personas learned from logs, and how well they match other days of the logs."""
