"""Expectations in a run: gauges measure their signals, block by block."""
