"""Start-up of flow under a sliding plate."""

from dataclasses import replace

from sim.studies.water import poiseuille

CASE = replace(poiseuille.CASE, name="couette", scene="couette", reference="u(y, t) of Morris, Fox & Zhu 1997, eq. 19")
