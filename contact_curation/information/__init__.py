"""How much each toss teaches: scores, Fisher matrices, criteria, ranking, streaming selection, diagnostics."""
