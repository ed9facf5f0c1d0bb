"""The live dashboard in Rerun."""
