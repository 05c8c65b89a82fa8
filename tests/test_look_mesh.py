"""The mesh under a plain look: twice as fine, its bias, elements out of proportion."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from look_checks import look, measured, texts

from femubench.core.effect.attachments import total_mass
from femubench.core.fem.frame import Factor, Frame, Place, PointMass, Preload
from femubench.core.fem.model import Model
from femubench.core.fem.parameters import Property
from femubench.core.fem.structure import Structure
from femubench.core.fit.mesh_error import mesh_bias, refine_mesh
from femubench.core.modal.frequency_changes import elastic_modes
from femubench.core.typing import FloatArray

FrameBuilder = Callable[..., Frame]


def frequencies(frame: Frame, count: int) -> FloatArray:
    return np.asarray(elastic_modes(Model.of(frame), count).natural_frequencies[:count])


def test_a_finer_mesh_is_the_mesh_with_twice_the_elements(ladder: FrameBuilder) -> None:
    coarse, fine = ladder(elements=4), ladder(elements=8)
    bias = mesh_bias(Model.of(coarse), 12)
    assert bias is not None
    np.testing.assert_allclose(
        bias, frequencies(fine, 12) / frequencies(coarse, 12) - 1.0, atol=1e-12
    )
    assert (bias < 0.0).all()  # a conforming mesh is too stiff


def test_a_finer_mesh_keeps_factors_springs_ends_and_changes(fitted_portal: FrameBuilder) -> None:
    factors = (Factor("E", ("m2/1",), 0.5), Factor("density", ("m3",), 1.5))
    frame = fitted_portal(3, factors=factors, preloads=(Preload("m2", 1e3),))
    structure = Structure.build(frame).with_values(
        [Property("EI", "EI", ("m4/2",)), Property("a", "rigid", ("m8@J5",), "m")], [0.7, 0.025]
    )
    finer = structure.rebuilt(refine_mesh(structure))
    assert len(finer.properties) > 1.9 * len(structure.properties) - 2
    for name in ("EIy", "rhoA", "GJ"):
        for label, rows in structure.label_index.items():
            values = getattr(finer.properties, name)[finer.label_index[label]]
            np.testing.assert_allclose(values, getattr(structure.properties, name)[rows[0]])
    assert total_mass(Model.of(finer)) == pytest.approx(total_mass(Model.of(structure)), rel=1e-9)
    bias = mesh_bias(Model.of(structure), 6)
    assert bias is not None
    assert np.abs(bias).max() < 0.01


def test_a_coarse_mesh_is_found_and_a_fine_one_is_not(ladder: FrameBuilder) -> None:
    for elements, expected in ((2, 1), (8, 0)):
        model = Model.of(ladder(polar=False, elements=elements))
        assert len(texts(look(model, measured(model)), "mesh is coarse")) == expected


def test_elements_out_of_proportion_are_found(ladder: FrameBuilder) -> None:
    frame = ladder()
    near = replace(frame, masses=(PointMass(Place(member="AB", s=0.256), 0.01),))
    model = Model.of(near)
    (warning,) = texts(look(model, measured(model)), "shorter than its neighbour")
    assert warning.where == "AB/2"
