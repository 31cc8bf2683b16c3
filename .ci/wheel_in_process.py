"""h5py and moraine._core in one process, each with an HDF5 of its own: python wheel_in_process.py h5py|moraine CASE

Steps a run of the case, reads with h5py what the run has written, and looks whether both HDF5 are there.
"""
import sys

first, case = sys.argv[1:]
if first == "h5py":
    import h5py
    import moraine._core
else:
    import moraine._core
    import h5py
import numpy as np
import moraine

with moraine.Run(case, force=True, set={"stage.settle.duration": "0.4 s"}) as run:
    assert run.step(50) == 50
    height = run.positions[:, 2].mean()
    run.checkpoint()
with h5py.File(f"{case}/output/checkpoint.h5") as file:
    names = []
    file.visit(names.append)
    assert names, "an empty checkpoint"
np.testing.assert_(height > 0)
hdf5 = {line.split()[-1] for line in open("/proc/self/maps") if "libhdf5" in line and ".so" in line and "_hl" not in line}
assert len(hdf5) == 2, hdf5
print(f"{first} first: 50 steps, {len(names)} items read back; HDF5 {h5py.version.hdf5_version} of h5py beside that of moraine._core")
