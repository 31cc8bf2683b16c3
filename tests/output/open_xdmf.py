"""Opens snapshots/grains.xdmf and contacts.xdmf as ParaView does: every time step, its points and its arrays; and where there
is pore water, water.xdmf and bed.xdmf with the cells of the grid.

usage: open_xdmf.py [--vtk | --xml] SNAPSHOTS    --xml: reads the XML alone, without VTK (water.xdmf and bed.xdmf)
exits 77 where there is no VTK that reads XDMF
"""
import sys
import xml.etree.ElementTree as ElementTree
from pathlib import Path

pressure = [100.0 * c for c in range(6)]  # of the test, in 2 x 1 x 3 cells, x fastest


def numbers(item):
    return [float(x) for x in item.text.split()]


def grids_of(step):
    """Of a step: itself, or what it collects."""
    return step.findall("Grid") if step.get("GridType") == "Collection" else [step]


def check_times(path):
    times = [float(step.find("Time").get("Value")) for step in ElementTree.parse(path).find("Domain/Grid").findall("Grid")]
    assert all(a < b for a, b in zip(times, times[1:])), f"{path}: times do not rise: {times}"


def check_xml(path, kinds):
    """The heights of the water's grid, by time."""
    heights = {}
    check_times(path)
    collection = ElementTree.parse(path).find("Domain/Grid")
    assert collection.get("CollectionType") == "Temporal"
    for step in collection.findall("Grid"):
        assert step.get("CollectionType") == ("Spatial" if len(kinds) > 1 else None), path
        grids = grids_of(step)
        assert [g.get("Name") for g in grids] == kinds, path
        for grid in grids:
            topology = grid.find("Topology")
            names = {a.get("Name"): a for a in grid.iterfind("Attribute")}
            if grid.get("Name") != "water":
                assert "water_force" in names and "radius" in names
                continue
            nodes = [int(n) for n in topology.get("Dimensions").split()]  # z, y, x
            assert topology.get("TopologyType") == "3DCoRectMesh" and nodes == [4, 2, 3], nodes
            origin, spacing = (numbers(item) for item in grid.find("Geometry"))
            assert origin == [0, 0, 0]
            heights[float(step.find("Time").get("Value"))] = spacing[0] * (nodes[0] - 1)
            assert set(names) == {"pressure", "porosity", "permeability", "flux"}
            for name, attribute in names.items():
                item = attribute.find("DataItem")
                assert attribute.get("Center") == "Cell"
                count = 1
                for n in item.get("Dimensions").split():
                    count *= int(n)
                assert count == (18 if name == "flux" else 6), (name, item.get("Dimensions"))
                file, dataset = item.text.split(":")
                assert (path.parent / file).exists() and dataset == f"/water/{name}"
    for time, height in heights.items():
        assert abs(height - time) < 1e-12, heights  # the test gives each step its height as time
    assert len(heights) == 2, heights
    print(path.name, "heights of the grid:", heights)


how = sys.argv[1] if sys.argv[1].startswith("--") else "--vtk"
directory = Path(sys.argv[-1])
if how == "--xml":
    check_xml(directory / "water.xdmf", ["water"])
    check_xml(directory / "bed.xdmf", ["grains", "water"])
    sys.exit(0)

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


def check_water(path, data, time):
    assert data.GetNumberOfCells() == 6, f"{path}: {data.GetNumberOfCells()} cells"
    bounds = data.GetBounds()
    assert all(abs(a - b) < 1e-12 for a, b in zip(bounds, (0, 3, 0, 3, 0, time))), f"{path}: bounds {bounds} at {time}"
    array = data.GetCellData().GetArray("pressure")
    assert [array.GetValue(c) for c in range(6)] == pressure, f"{path}: pressure"
    assert data.GetCellData().GetArray("flux").GetNumberOfTuples() == 6
    print(path.name, time, "s:", bounds)


def check(path):
    steps = {}
    check_times(path)
    for step in ElementTree.parse(path).find("Domain/Grid").findall("Grid"):
        steps[float(step.find("Time").get("Value"))] = grids_of(step)

    complaints = []
    vtk.vtkOutputWindow.GetInstance().AddObserver("ErrorEvent", lambda *_: complaints.append("an error"))
    reader = Reader()
    reader.SetFileName(str(path))
    reader.UpdateInformation()
    times = reader.GetOutputInformation(0).Get(vtk.vtkStreamingDemandDrivenPipeline.TIME_STEPS()) or ()
    assert sorted(times) == sorted(steps), f"{path}: times {times}, expected {sorted(steps)}"
    for time in times:
        reader.UpdateTimeStep(time)
        found = leaves(reader.GetOutputDataObject(0))
        assert len(found) == len(steps[time]), f"{path}: {len(found)} grids"
        for data, grid in zip(found, steps[time]):
            if grid.get("Name") == "water":
                check_water(path, data, time)
                continue
            names = [a.get("Name") for a in grid.iterfind("Attribute")]
            count = int(grid.find("Topology").get("NumberOfElements"))
            shown = data.GetNumberOfPoints(), data.GetNumberOfCells()
            assert shown == (count, count), f"{path}: {shown} points and vertices, {count} expected"
            for name in names:
                array = data.GetPointData().GetArray(name)
                assert array and array.GetNumberOfTuples() == count, f"{path}: {name} at t = {time} s"
                if name == "radius":
                    assert array.GetRange()[0] > 0, f"{path}: radius {array.GetRange()}"
            print(path.name, time, "s:", count, "points with", ", ".join(names))
    assert not complaints, f"{path}: VTK complained"


for name in ("grains.xdmf", "contacts.xdmf", "water.xdmf", "bed.xdmf"):
    if name in ("grains.xdmf", "contacts.xdmf") or (directory / name).exists():
        check(directory / name)
