"""Gauges: they measure the signals of expectations during a run, block by block."""
