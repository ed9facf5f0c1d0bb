"""`reproduce against-sysid`: what engineers would pick instead of this package, on the same tosses."""
