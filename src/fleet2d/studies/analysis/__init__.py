"""The analysis of a study: its tables, statistics, figures and report."""
