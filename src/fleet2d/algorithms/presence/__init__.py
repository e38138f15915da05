"""Where people are: over weeks (long-term presence), and now (real-time presence)."""
