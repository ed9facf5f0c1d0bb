"""Training on tosses, and what comes of it: re-ranking, checkpoints, errors of motion, what is known of theta."""
