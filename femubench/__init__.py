"""femubench: which finite element model updating strategies hold up.

What a user calls is a name of this module; what an author of a strategy, an effect or a report
needs as well is in `femubench.fem`, `.modal`, `.update`, `.effect`, `.diagnosis`, `.results`,
`.reproduction`. Names are imported on first use, so that ``import femubench`` costs nothing.

The example of every function starts from these lines:

>>> import numpy as np
>>> import femubench
>>> from femubench import diagnosis, effect, fem, modal, plot, reproduction, results, update
>>> case = femubench.cases["frame"]
>>> model, measurement = case.model, case.used_measurement()
>>> structure = model.frame_structure
>>> frame, properties = structure.frame, structure.properties
>>> readings = model.observe(measurement.sensors)
>>> modes = femubench.solve_modes(model)
>>> stiffness = fem.Property("E", "E", structure.elements)
>>> joints = update.Joints(structure).groups()
>>> joint = update.Changes(structure).joint(joints[0])
>>> nominal, scaled = femubench.strategies["unchanged"], femubench.strategies["global"]
>>> result = scaled.update(model, measurement, None)
>>> run = femubench.rank(case, [nominal, scaled], nominal="drawn")
>>> torsion = femubench.effects["torsion-constant"]
>>> found = femubench.diagnose(case, torsion, pairs=False)
>>> lines, sensors = np.linspace(200.0, 300.0, 401), measurement.sensors
>>> force = femubench.Sensors(("9Z",), sensors.xyz[8:9], sensors.directions[8:9])
>>> curves = modal.receptance(modes, readings, readings[8:9], lines, 0.005)
>>> responses = modal.FrequencyResponses(sensors, force, lines, curves)
>>> identified = femubench.identify(responses)
"""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

if not os.path.isdir(os.path.join(os.path.dirname(__file__), "core")):
    raise ImportError(
        "femubench/core is no link to the folder core: clone once more with "
        "`git clone -c core.symlinks=true` (on Windows, in developer mode)"
    )

from femubench.core.plugin.door import open_door

if TYPE_CHECKING:
    from femubench.core.case.case import Case as Case
    from femubench.core.diagnosis.result import Diagnosis as Diagnosis
    from femubench.core.errors import (
        Diverged as Diverged,
        FemubenchError as FemubenchError,
        InputError as InputError,
        NotApplicable as NotApplicable,
        StrategyFailure as StrategyFailure,
    )
    from femubench.core.fem.model import Model as Model
    from femubench.core.fem.sensors import Sensors as Sensors
    from femubench.core.identify.identification import Identification as Identification
    from femubench.core.library.cases import (
        cases as cases,
        effects as effects,
        read_case as read_case,
        strategies as strategies,
    )
    from femubench.core.library.challenge import (
        challenge as challenge,
        score_challenge as score_challenge,
    )
    from femubench.core.library.compare import compare as compare
    from femubench.core.library.diagnose import diagnose as diagnose
    from femubench.core.library.identify import identify as identify
    from femubench.core.library.models import read_model as read_model, write_model as write_model
    from femubench.core.library.plugins import (
        check as check,
        init_case as init_case,
        new_plugin as new_plugin,
    )
    from femubench.core.library.publish import publish as publish
    from femubench.core.library.rank import Run as Run, rank as rank, read_run as read_run
    from femubench.core.library.report import report as report
    from femubench.core.library.reproduce import reproduce as reproduce
    from femubench.core.library.study import study as study
    from femubench.core.modal.eigen import Modes as Modes, solve_modes as solve_modes
    from femubench.core.modal.measurement import Measurement as Measurement
    from femubench.core.plugin.markers import hookimpl as hookimpl
    from femubench.core.roles import Reader as Reader, Scenario as Scenario
    from femubench.core.update.strategy import (
        ParameterEstimate as ParameterEstimate,
        Strategy as Strategy,
        UpdateResult as UpdateResult,
    )
    from femubench.core.version import __version__ as __version__
else:
    __all__, __getattr__, __dir__ = open_door(__name__, __file__)
