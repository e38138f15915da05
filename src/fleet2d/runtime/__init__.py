"""The foundations of every run: simulated time, events, and reproducible randomness."""
