"""Who works: this process, others of this machine, or a cluster."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING

from baselines.workers.processes import Processes
from ikgym.validation import known_name, whole_number

if TYPE_CHECKING:
    from baselines.workers.pool import Pool

#: Kinds of clusters.
CLUSTERS = ("ray",)


@dataclasses.dataclass(frozen=True)
class Workers:
    """Who works.

    Args:
        number: Processes of this machine; 1 means this one.
        cluster: The kind of a cluster, one of :data:`CLUSTERS`, which takes precedence; None for none.

    Raises:
        InvalidInputError: The number is no whole number of at least 1.
        UnknownNameError: There is no such kind of cluster.
    """

    number: int = 1
    cluster: str | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "number", whole_number("workers", self.number, at_least=1))
        if self.cluster is not None:
            known_name("cluster", self.cluster, CLUSTERS)

    @property
    def here(self) -> bool:
        """Whether this process does everything itself."""
        return self.cluster is None and self.number == 1

    def check(self) -> None:
        """Insists that a cluster can be reached if one is asked for: before anything is written, or overwritten.

        Raises:
            MissingDependencyError: The package of the cluster is not installed.
            ClusterError: No address is known, or nobody answers there.
        """
        if self.cluster is not None:
            # The only module that imports an extra, which few have.
            from baselines.workers import ray_cluster

            ray_cluster.check()

    def pool(self, units: int) -> Pool:
        """The workers for so many units, to be used as a context.

        Raises:
            MissingDependencyError: The package of the cluster is not installed.
            ClusterError: The cluster cannot be reached.
        """
        if self.cluster is None:
            return Processes(min(self.number, max(units, 1)))
        from baselines.workers.ray_cluster import RayPool  # see above

        return RayPool()


#: This process, and no other.
ALONE = Workers()
