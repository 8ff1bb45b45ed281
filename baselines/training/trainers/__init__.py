"""One trainer a method of learning."""
