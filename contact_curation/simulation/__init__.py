"""The simulated world: bodies that move in an engine of its own, MuJoCo."""
