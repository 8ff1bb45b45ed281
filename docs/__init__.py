"""Documentation, and the code that writes its tables."""
