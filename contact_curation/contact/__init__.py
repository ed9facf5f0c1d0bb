"""The contact model: body, parameters, loss, score, time step."""
