"""The tables of a run: their columns, and what fills them."""
