"""Independent work, shared among processes of this machine or the workers of a Dask scheduler."""

from expdesign.processes.sharing import (
    ahead,
    as_finished,
    begin,
    in_order,
    local_processes,
    on_cluster,
    processors,
    reported_together,
    shared_among,
)
