"""Many recordings: what was read and scored before, and a cluster that reads and scores."""
