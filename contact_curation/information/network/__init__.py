"""Information about networks, without forming their gradients."""
