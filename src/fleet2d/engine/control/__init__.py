"""Control of a simulation: scripts, interventions, and what a program does with it."""
