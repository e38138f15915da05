"""Reading runs back: their tables, the path of each body, moments, layers."""
