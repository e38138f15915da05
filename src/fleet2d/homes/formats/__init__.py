"""Files of other programs that floor plans are read from, one format a module."""
