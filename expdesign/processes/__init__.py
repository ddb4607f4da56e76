"""Independent work, shared among processes of this machine or the workers of a Dask scheduler."""

from expdesign.processes.reporting import reported_together
from expdesign.processes.sharing import (
    ahead,
    as_finished,
    begin,
    in_order,
    local_processes,
    on_cluster,
    processors,
    shared_among,
)
