"""What an author of an effect needs: places, parameters, the change of mass and stiffness."""

from femubench.core.change.change import Change as Change, proportional as proportional
from femubench.core.change.interpolation import (
    barycentric as barycentric,
    chebyshev_nodes as chebyshev_nodes,
)
from femubench.core.change.parameter import Parameter as Parameter
from femubench.core.change.tabulated import tabulate_change as tabulate_change
from femubench.core.change.terms import (
    ElementOperator as ElementOperator,
    MatrixOperator as MatrixOperator,
    Operator as Operator,
    RowOperator as RowOperator,
    Term as Term,
    sparse_term as sparse_term,
)
from femubench.core.effect.attachments import (
    elastic_band as elastic_band,
    elongation_row as elongation_row,
    find_directed_point as find_directed_point,
    free_translations as free_translations,
    list_directed_places as list_directed_places,
    mass_term as mass_term,
    point_in as point_in,
    point_motion as point_motion,
    total_mass as total_mass,
    translation_rows as translation_rows,
    with_extra as with_extra,
)
from femubench.core.effect.flexible_ends import (
    end_arm as end_arm,
    end_room as end_room,
    end_stiffness as end_stiffness,
    flexible_ends_change as flexible_ends_change,
    free_arm_change as free_arm_change,
    rate_nodes as rate_nodes,
    soften_ends as soften_ends,
)
from femubench.core.effect.flexible_supports import (
    flexible_supports_change as flexible_supports_change,
    release_supports as release_supports,
    soften_supports as soften_supports,
)
from femubench.core.effect.frame_effect import FrameEffect as FrameEffect
from femubench.core.effect.interfaces import (
    facing_nodes as facing_nodes,
    interface_directions as interface_directions,
    interface_places as interface_places,
    node_pairs as node_pairs,
)
from femubench.core.effect.places import (
    APART as APART,
    FREE as FREE,
    bare_place as bare_place,
    branch_places as branch_places,
    element_labels as element_labels,
    elements_of as elements_of,
    end_places as end_places,
    ends_of as ends_of,
    joint_types as joint_types,
    joints_of as joints_of,
    joints_with_members as joints_with_members,
    member_labels as member_labels,
    member_length as member_length,
    members_at as members_at,
    members_of as members_of,
    pair_of as pair_of,
    point_of as point_of,
    point_places as point_places,
    set_places as set_places,
    split_direction as split_direction,
    support_places as support_places,
    supports_of as supports_of,
    type_place as type_place,
    type_places as type_places,
)
from femubench.core.effect.reading import Reading as Reading
from femubench.core.effect.sizes import Site as Site, Size as Size
from femubench.core.effect.suspect import Corrected as Corrected, Suspect as Suspect
from femubench.core.effect.textbook import (
    textbook_model as textbook_model,
    textbook_values as textbook_values,
)
from femubench.core.look.modes import Seen as Seen
from femubench.core.modal.eigen import once_for as once_for
from femubench.core.roles import Effect as Effect, Fault as Fault
from femubench.core.schema.diagnosis import LookWarning as LookWarning

__all__ = [name for name in dir() if not name.startswith("_")]
