"""Public datasets in and out."""
