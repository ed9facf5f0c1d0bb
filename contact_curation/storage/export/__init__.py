"""Selected tosses for other tools."""
