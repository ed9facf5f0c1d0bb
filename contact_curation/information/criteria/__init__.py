"""Selection criteria, a file each, with their bounds."""
