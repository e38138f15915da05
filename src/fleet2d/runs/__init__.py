"""Reading runs back: their tables, the way of each body, moments, layers."""
