"""The functions of bench/cost_model.py against values worked out by hand."""
import sys

import pytest

from conftest import root

sys.path.insert(0, str(root / "bench"))
import cost_model as model  # noqa: E402

near = model.Machine(near_latency=1e-6, near_bandwidth=1e9, memory=1e15)
measured = model.Measured(step_of_grain={1000: 10e-9, 100_000: 30e-9}, beside={1000: 20e-9}, ghosts_of_face=1.5, slots_of_ghost=2,
                          steps_of_search=100, look=1e-7, tally=5e-9, row=2e-9, state_bytes=400)


def test_chunks_are_those_of_the_program():
    assert [model.chunk_size(n) for n in (100, 10_000, 90_000)] == [128, 640, 1024]
    assert [model.chunk_count(n) for n in (100, 10_000, 90_000)] == [1, 16, 88]


def test_chunks_are_dealt_to_ranks_as_evenly_as_they_can():
    assert list(model.dealt(5, 2)) == [0, 0, 1, 1, 1]
    assert list(model.dealt(3, 3)) == [0, 1, 2]
    assert model.unevenness(16, 4) == 1
    assert model.unevenness(5, 2) == pytest.approx(3 / 2.5)


def test_a_high_bed_is_halved_in_height_and_has_one_face():
    area, pairs = model.meetings((1, 1, 2), 2, 2, 0.01)
    assert area == pytest.approx(1) and pairs == {(0, 1)}


def test_a_long_bed_is_halved_across_and_has_a_face_on_both_sides():
    area, pairs = model.meetings((10, 1, 1), 2, 2, 0.01)
    assert area == pytest.approx(2) and pairs == {(0, 1)}


def test_four_quarters_meet_across_periodic_sides():
    # Cut across x (10), then each half (5 long) across x again: four slices in a ring, of which only neighbours meet.
    area, pairs = model.meetings((10, 1, 1), 4, 4, 0.01)
    assert area == pytest.approx(4) and pairs == {(0, 1), (1, 2), (2, 3), (0, 3)}


def test_traffic_is_ghosts_of_faces_and_shares_of_ghosts():
    bed = model.Bed((1, 1, 2), 200, 0.1)
    t = model.traffic(bed, 2, measured)
    assert t["ghosts"] == pytest.approx(150)  # 1 m2 of 0.01 m2 each
    assert t["bytes"] == pytest.approx(150 * (72 + 2 * 52)) and t["messages"] == 2
    assert model.traffic(bed, 1, measured) == dict(ghosts=0, bytes=0, messages=0)


def test_a_grain_takes_what_is_between_the_sizes_measured():
    assert measured.grain(10_000, 1) == pytest.approx(20e-9)
    assert measured.grain(10, 1) == 10e-9 and measured.grain(10_000, 2) == 20e-9


def test_totals_have_numbers_of_chunks_and_of_ranks():
    assert model.totals_bytes(100, 4, 2) == 8 * (4 * 100 + 6 * 4)
    assert model.totals_bytes(100, 4, 2, group=64) == 8 * (4 * 2 + 6 * 4)


def test_gather_within_a_node():
    ways = model.gather(4, 4000, near)
    assert ways["ring"] == pytest.approx(3e-6 + 3e-6)      # three turns, and 3,000 bytes at 1 GB/s
    assert ways["doubling"] == pytest.approx(2e-6 + 3e-6)  # two turns
    assert set(model.gather(1, 4000, near).values()) == {0.0}


def test_one_rank_pays_nothing_for_others():
    parts = model.step(model.Bed((1, 1, 2), 1000, 0.1), 1, measured, near, record_every=10)
    assert parts.pop("grains") == pytest.approx(1000 * 10e-9)
    assert set(parts.values()) == {0.0}


def test_a_rank_looks_among_the_cells_of_its_neighbours_only():
    few, many = (model.search(model.Bed((1, 1, 2), 100 * ranks, 0.1), ranks, measured, near) for ranks in (70, 100))
    bits = [8 * -(-model.cells(model.Bed((1, 1, 2), 100 * ranks, 0.1)) // 64) for ranks in (70, 100)]
    assert bits[0] == bits[1]
    gathered = [min(w["ring"], w["doubling"]) for w in (model.gather(r, b * r, near) for r, b in zip((70, 100), bits))]
    assert many - few == pytest.approx(gathered[1] - gathered[0] + (99 - 69) * bits[0] / 8 * 0.5e-9)
