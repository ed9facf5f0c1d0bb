"""Training on tosses: re-ranking, checkpoints, evaluation, and the uncertainty of theta."""
