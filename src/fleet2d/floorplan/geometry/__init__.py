"""The lattice that everything lies on, the triangle mesh between walls, and gates in it."""
