"""The server of the page: stored runs, and running simulations that it watches and controls."""
