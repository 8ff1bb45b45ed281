"""What MkDocs runs to make a site of these pages: ``make docs``."""
