"""Opens snapshots/grains.xdmf and contacts.xdmf as ParaView does: every time step, its points and its arrays.

usage: open_xdmf.py SNAPSHOTS    exits 77 where there is no VTK that reads XDMF
"""
import sys
import xml.etree.ElementTree as ElementTree
from pathlib import Path

try:
    import vtk
except ImportError:
    print("no vtk for this python")
    sys.exit(77)
Reader = getattr(vtk, "vtkXdmf3Reader", None) or getattr(vtk, "vtkXdmfReader", None)
if Reader is None:
    print("this vtk has no XDMF reader:", vtk.vtkVersion().GetVTKVersion())
    sys.exit(77)


def leaves(data):
    """The data sets of a step, whether alone or in blocks."""
    if not hasattr(data, "GetNumberOfBlocks"):
        return [data]
    return [leaf for k in range(data.GetNumberOfBlocks()) for leaf in leaves(data.GetBlock(k))]


def check(path):
    steps = {}
    for grid in ElementTree.parse(path).iterfind(".//Grid/Grid"):
        names = [a.get("Name") for a in grid.iterfind("Attribute")]
        count = int(grid.find("Topology").get("NumberOfElements"))
        steps[float(grid.find("Time").get("Value"))] = count, names

    complaints = []
    vtk.vtkOutputWindow.GetInstance().AddObserver("ErrorEvent", lambda *_: complaints.append("an error"))
    reader = Reader()
    reader.SetFileName(str(path))
    reader.UpdateInformation()
    times = reader.GetOutputInformation(0).Get(vtk.vtkStreamingDemandDrivenPipeline.TIME_STEPS()) or ()
    assert sorted(times) == sorted(steps), f"{path}: times {times}, expected {sorted(steps)}"
    for time in times:
        reader.UpdateTimeStep(time)
        (data,) = leaves(reader.GetOutputDataObject(0))
        count, names = steps[time]
        found = data.GetNumberOfPoints(), data.GetNumberOfCells()
        assert found == (count, count), f"{path}: {found} points and vertices, {count} expected"
        for name in names:
            array = data.GetPointData().GetArray(name)
            assert array and array.GetNumberOfTuples() == count, f"{path}: {name} at t = {time} s"
            if name == "radius":
                assert array.GetRange()[0] > 0, f"{path}: radius {array.GetRange()}"
        print(path.name, time, "s:", count, "points with", ", ".join(names))
    assert not complaints, f"{path}: VTK complained"


for name in ("grains.xdmf", "contacts.xdmf"):
    check(Path(sys.argv[1]) / name)
