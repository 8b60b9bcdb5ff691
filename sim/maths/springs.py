"""Springs as constraints. Pure functions; every argument may be a number or a vector of lanes."""

import taichi as ti


@ti.func
def spring_scale(length, rest, stiffness, inv_mass_a, inv_mass_b, moved):
    """s of the XPBD correction x_a += s w_a d, x_b -= s w_b d, with d = x_b - x_a.

    s = (1 - rest/length) k/(1 + k (w_a + w_b)), k = stiffness h^2 (Macklin 2016, eq. 18, first iteration; h the
    substep). `moved` in [0, 1] is the share of w_a to leave out: see sim.cloth.sweep.
    Units: lengths m, k in kg, w in 1/kg. A length of 0 gives no correction, for it has no direction.
    """
    resist = ti.max(1.0 + stiffness * (inv_mass_b + (1.0 - moved) * inv_mass_a), stiffness * (inv_mass_a + inv_mass_b))
    return stiffness * (length - rest) / (ti.max(length, 1e-12) * resist)


@ti.func
def limit_scale(length, longest, inv_mass_a, inv_mass_b):
    """s as above that brings a spring back to `longest` at once; negative for a shorter one (Provot 1995)."""
    return (length - longest) / (ti.max(length, 1e-12) * ti.max(inv_mass_a + inv_mass_b, 1e-12))
