"""What every run builds upon: simulated time, events, and reproducible randomness."""
