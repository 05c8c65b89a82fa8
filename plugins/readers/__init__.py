"""Readers of file formats that the case format does not know by itself."""

from __future__ import annotations

from femubench import hookimpl


@hookimpl
def femubench_readers() -> dict[str, str]:
    """Return where the built-in readers are."""
    return {
        "universal file": f"{__name__}.universal:UniversalReader",
        "npz": f"{__name__}.npz:NpzReader",
        "HDF5": f"{__name__}.hdf5:Hdf5Reader",
        "MATLAB": f"{__name__}.matlab:MatlabReader",
        "LabVIEW": f"{__name__}.labview:LabViewReader",
        "Nastran OP4": f"{__name__}.op4:Op4Reader",
        "Nastran DMIG": f"{__name__}.dmig:DmigReader",
        "Nastran bulk data": f"{__name__}.bulk_data:BulkDataReader",
        "CalculiX": f"{__name__}.calculix:CalculixReader",
        "Abaqus": f"{__name__}.abaqus:AbaqusReader",
        "Ansys": f"{__name__}.ansys:AnsysReader",
    }
