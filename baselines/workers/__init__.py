"""Units of work that other processes do: of this machine, or of a cluster. One interface for both."""

from baselines.workers.choice import ALONE, CLUSTERS, Workers
from baselines.workers.pool import TOLERANCE, TRIES, ClusterError, LostError, Pool, Report, WorkerError, finished

__all__ = [
    "ALONE",
    "CLUSTERS",
    "TOLERANCE",
    "TRIES",
    "ClusterError",
    "LostError",
    "Pool",
    "Report",
    "WorkerError",
    "Workers",
    "finished",
]
