"""Calibration: models fitted to logs of real devices; the core never imports it."""
