"""What simulated people are worth to models that are used in real homes: `fleet2d transfer`."""
