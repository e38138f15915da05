"""Files that floor plans are read from and written to, one format a module."""
