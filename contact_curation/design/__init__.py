"""Design of throws: candidates, their predicted information, safety, and the choice of the next throws."""
