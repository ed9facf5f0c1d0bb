"""A pose stream becomes tosses: segmenting, smoothing, gates, transitions."""
