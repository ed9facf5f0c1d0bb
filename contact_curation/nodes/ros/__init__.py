"""What all nodes share: parameters, quality of service, workers, delivery of numbered messages."""
