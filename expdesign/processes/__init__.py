"""Independent work, shared among processes of this machine or the workers of a Dask scheduler."""

from expdesign.processes.sharing import as_finished, begin, in_order, leaving_interruptions, local_processes, on_cluster
from expdesign.processes.telling import told_together

__all__ = [
    "as_finished",
    "begin",
    "in_order",
    "leaving_interruptions",
    "local_processes",
    "on_cluster",
    "told_together",
]
