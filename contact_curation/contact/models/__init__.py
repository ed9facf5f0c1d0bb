"""The models of contact, a file each with all of its behaviour, and their registry."""
