"""Programs of MkDocs that make a site of these pages: ``make docs``."""
