"""Tuning: a search for settings on training homes, evaluated on other homes."""
