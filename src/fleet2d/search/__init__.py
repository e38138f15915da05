"""Search: orders in which to look for a person, as functions of probabilities and distances."""
