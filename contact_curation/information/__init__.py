"""The information of tosses about theta: scores, Fisher matrices, criteria, ranking, streaming selection, diagnostics."""
