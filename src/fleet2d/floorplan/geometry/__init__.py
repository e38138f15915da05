"""The lattice of all positions, the triangle mesh between walls, and gates in the mesh."""
