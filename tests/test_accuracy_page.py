"""The page on TimLab's accuracy: its table is that of the stored measurement, which has all twelve systems."""

from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]


def test_the_table_is_that_of_the_stored_measurement():
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(ROOT))
        from tools.accuracy.__main__ import PAGE, SYSTEMS, page, table

        assert page() == PAGE.read_text(encoding="utf-8")
        assert [line.split(" | ")[0][2:] for line in table().splitlines()[2:-1]] == [each.name for each in SYSTEMS]
