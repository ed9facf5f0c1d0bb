"""A box and its contacts, identified from tosses by MuJoCo's own motions: what engineers would do without this package."""
