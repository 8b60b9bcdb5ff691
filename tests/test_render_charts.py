"""Charts are drawn from their CSV alone."""

import imageio.v3 as iio
import pytest

from render.charts import ledger_chart, read_table
from sim.errors import RunError

HEADER = (
    "frame,time,emitted,free,held,film,drained,dried,mass_error,leaks,passed,"
    "density_error,max_speed,kinetic_energy,max_strain,dt"
)


def test_ledger_of_a_full_run(tmp_path):
    tail = "0,,0,0,0,0.001,1.2,0.01,0.02,0.001"
    rows = [f"{i},{i / 30},{i * 1e-3},{i * 6e-4},{i * 3e-4},{i * 1e-4},{tail}" for i in range(40)]
    (tmp_path / "ledger.csv").write_text("\n".join([HEADER, *rows]) + "\n")
    ledger_chart(tmp_path / "ledger.csv", tmp_path / "ledger.png")
    picture = iio.imread(tmp_path / "ledger.png")
    assert picture.shape[1] > 900 and picture.std() > 10
    assert sorted(p.name for p in tmp_path.iterdir()) == ["ledger.csv", "ledger.png"]


def test_columns_that_are_not_modelled_are_left_out(tmp_path):
    rows = [f"{i},{i / 30},,,,,,,,,,,0.3,0.01,0.02,0.001" for i in range(10)]
    (tmp_path / "ledger.csv").write_text("\n".join([HEADER, *rows]) + "\n")
    ledger_chart(tmp_path / "ledger.csv", tmp_path / "ledger.png")
    assert (tmp_path / "ledger.png").stat().st_size > 5000


def test_a_broken_table_is_named(tmp_path):
    (tmp_path / "a.csv").write_text("time,mass\n1,heavy\n")
    with pytest.raises(RunError, match="not a table of numbers"):
        read_table(tmp_path / "a.csv")
    with pytest.raises(RunError, match="cannot read"):
        read_table(tmp_path / "none.csv")
