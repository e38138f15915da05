"""Metrics of presence: errors of long-term presence, and scores of real-time presence."""
