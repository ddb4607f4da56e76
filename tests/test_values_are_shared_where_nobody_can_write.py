import numpy as np
import pytest

from expdesign.values import closed, readonly


def test_an_array_that_somebody_can_write_to_is_copied():
    mine = np.arange(3.0)
    view = mine[1:]
    view.setflags(write=False)
    kept = readonly(view)
    mine[1] = 7.0
    assert kept.tolist() == [1.0, 2.0]
    with pytest.raises(ValueError, match="read-only"):
        kept[0] = 1.0


def test_an_array_that_nobody_can_write_to_is_shared_with_its_views():
    whole = closed(np.zeros((2, 3)).transpose())
    assert readonly(whole) is whole
    assert np.shares_memory(readonly(whole[1:]), whole)
    with pytest.raises(ValueError, match="read-only"):
        whole.base[0] = 1.0


def test_other_types_become_floats():
    assert readonly(closed(np.arange(3))).dtype == float
