"""The version, which runs and snapshots are stored with."""

__version__ = "0.1.0"
