"""The page of robustness: what imperfect plants cost policies, set by set and over two severities."""
