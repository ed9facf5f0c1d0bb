"""What models would be had they learned from other tosses: exact refits on random subsets, and scores that foresee them."""
