"""Cloth that meets itself, solids and air: nothing passes, folds rest, clips go their way, bits repeat."""

import fold_scenes as scenes
import numpy as np
import pytest
from spawned import spawn

from sim.studies.exact_ccd import meets


@pytest.fixture(scope="module")
def pile():
    return spawn(scenes.pile)


def test_a_piercing_edge_is_seen():
    from sim.studies.crossings import crossings

    flat = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0.2, 0.2, -1], [0.2, 0.2, 1], [3, 3, 0.5]], float)
    triangles = np.array([[0, 1, 2], [3, 4, 5]])
    assert crossings(flat, triangles) == 2  # the upright edge, and one of the flat triangle through the other
    flat[3:, 0] -= 1.0
    assert crossings(flat, triangles) == 0


def test_ways_that_meet_are_found_and_others_not():
    """Made to meet and to miss; and hard ones, against rational arithmetic."""
    kinds, hard = ("point", "edges"), scenes.ways_hard(40)
    made = [(kind, x) for kind in kinds for x in scenes.ways_made(kind)]
    hits = spawn(scenes.met, made + [(kind, x) for kind in kinds for x in hard.values()])
    for kind in kinds:
        assert hits.pop(0).all() and not hits.pop(0).any(), kind
    for kind in kinds:
        for name, x in hard.items():
            truth = [meets(query, edges=kind == "edges") for query in x]
            missed = [n for n, (t, hit) in enumerate(zip(truth, hits.pop(0))) if t and not hit]
            assert not missed, (kind, name)
            assert kind == "point" or True in truth


def test_a_pile_never_pierces_itself(pile):
    found, strain, *_, counts, settled = pile
    assert settled == 0  # it would be some hundred, were settling blind to contact
    assert found == [0] * len(found)
    assert strain < 0.105
    assert counts["carried"] <= 6  # one pinch: a node that goes through a turning triangle and comes back


def test_a_pile_goes_on_from_a_checkpoint_to_the_same_bits(pile):
    _, _, ahead, again, *_ = pile
    assert ahead == again


def test_threads_do_not_change_a_bit_of_a_pile(pile):
    assert pile[2] == spawn(scenes.pile_on_one_thread)


def test_penalty_claps_and_robust_comes_to_rest():
    energy, moved, found = spawn(scenes.clap, "robust", 70)
    assert energy < 1e-6 and moved < 1e-3 and found == 0
    energy, *_ = spawn(scenes.clap, "penalty", 25)
    assert energy > 1e-3


def test_clips_carry_what_they_hold_and_give_way():
    off, now, strain, given, pulls = spawn(scenes.hands)
    assert off < 1e-6 and now == pytest.approx(0.6, abs=1e-4) and strain < 0.105
    assert given[0] > 5e-3 and given[1] < -5e-3
    assert pulls == pytest.approx([3.0, 3.0], rel=0.4)


def test_wind_pushes_as_hard_as_on_a_plate():
    """Face on: C_N rho_a u^2/(2 rho_A)."""
    along = spawn(scenes.blown, "[2,0,0]")
    assert along[0] == pytest.approx(1.2 * 1.2 * 4.0 / (2.0 * 0.15), rel=0.03)
    assert np.abs(along[1:]).max() < 1e-3
