"""The report of a folder of results: one page with tables, plots and replays, which needs no network."""
