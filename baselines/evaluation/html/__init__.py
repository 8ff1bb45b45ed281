"""The report of a folder of results: one page with tables, plots and replays, which needs no network.

Python puts the data together and writes the tables; Plotly draws; the scripts beside this file connect the two.
"""

from baselines.evaluation.html.page import page

__all__ = ["page"]
