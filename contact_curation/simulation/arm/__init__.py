"""The simulated arm: model, limits, motion planning, safety, simulation."""
