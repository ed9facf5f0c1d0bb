"""The four models of contact, a file each, and their registry."""
