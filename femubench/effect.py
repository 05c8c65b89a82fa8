"""What an author of an effect needs: places, parameters, the change of mass and stiffness."""

from femubench.core.change.change import Change as Change
from femubench.core.change.interpolation import ChebyshevPoints as ChebyshevPoints
from femubench.core.change.parameter import Parameter as Parameter
from femubench.core.change.terms import (
    ElementOperator as ElementOperator,
    RowOperator as RowOperator,
    Term as Term,
)
from femubench.core.effect.frame_effect import FrameEffect as FrameEffect
from femubench.core.effect.model_places import (
    ModelPlaces as ModelPlaces,
    elastic_band as elastic_band,
)
from femubench.core.effect.places import Places as Places
from femubench.core.effect.reading import Reading as Reading
from femubench.core.effect.sizes import Site as Site, Size as Size
from femubench.core.effect.suspect import Suspect as Suspect
from femubench.core.effect.textbook import (
    textbook_model as textbook_model,
    textbook_values as textbook_values,
)
from femubench.core.look.modes import Seen as Seen
from femubench.core.modal.eigen import once_for as once_for
from femubench.core.schema.diagnosis import LookWarning as LookWarning

__all__ = [name for name in dir() if not name.startswith("_")]
