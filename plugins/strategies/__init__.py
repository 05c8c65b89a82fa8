"""The updating strategies that come with femubench, one file each."""

from __future__ import annotations

from femubench import Strategy, hookimpl


@hookimpl
def femubench_strategies() -> tuple[type[Strategy], ...]:
    """Return the strategies of both papers in the papers' order, then `diagnosed`."""
    from femubench.plugins.strategies.baruch import Baruch
    from femubench.plugins.strategies.bayesian import Bayesian
    from femubench.plugins.strategies.berman import Berman
    from femubench.plugins.strategies.diagnosed import Diagnosed
    from femubench.plugins.strategies.generic_adjusted import GenericAdjusted
    from femubench.plugins.strategies.generic_ls import GenericLS
    from femubench.plugins.strategies.global_ import Global
    from femubench.plugins.strategies.kabe import Kabe
    from femubench.plugins.strategies.kabe_rigid import KabeRigid
    from femubench.plugins.strategies.local import Local
    from femubench.plugins.strategies.nobari import Nobari
    from femubench.plugins.strategies.nobari_rigid import NobariRigid
    from femubench.plugins.strategies.offset import Offset
    from femubench.plugins.strategies.physical import Physical
    from femubench.plugins.strategies.spring import Spring
    from femubench.plugins.strategies.unchanged import Unchanged

    return (
        Unchanged,
        Baruch,
        Berman,
        Kabe,
        KabeRigid,
        Physical,
        Nobari,
        NobariRigid,
        GenericLS,
        GenericAdjusted,
        Global,
        Local,
        Spring,
        Offset,
        Bayesian,
        Diagnosed,
    )
