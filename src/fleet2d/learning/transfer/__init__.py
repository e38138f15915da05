"""The worth of simulated people for models in real homes: `fleet2d transfer`."""
