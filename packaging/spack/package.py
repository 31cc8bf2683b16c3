# Goes into a Spack repository as packages/moraine/package.py; see ../README.md for how far it was tried.
from spack.package import *


class Moraine(PythonPackage):
    """Grain-scale till mechanics: a discrete element code for beds of grains that are sheared under a glacier."""

    license("GPL-3.0-or-later")

    # No release has an address yet: `spack dev-build moraine@main` builds the folder it is called in.
    version("main", branch="main", no_cache=True)

    variant("mpi", default=False, description="Share a bed between processes, by MPI")
    variant("cuda", default=False, description="Compute on NVIDIA GPUs")

    depends_on("c", type="build")
    depends_on("cxx", type="build")
    depends_on("cmake@3.24:", type="build")
    depends_on("ninja", type="build")
    depends_on("pkgconfig", type="build")
    depends_on("tomlplusplus", type="build")
    depends_on("cli11@2:", type="build")
    depends_on("py-scikit-build-core@0.10:", type="build")
    depends_on("py-nanobind@2.2:", type="build")

    depends_on("hdf5@1.10.7:~mpi+hl", type=("build", "link"))
    depends_on("openssl", type=("build", "link"))
    depends_on("udunits", type=("build", "link", "run"))
    depends_on("suite-sparse", type=("build", "link"))
    depends_on("sundials@6+ARKODE~mpi", type=("build", "link"))
    depends_on("mpi", when="+mpi")
    depends_on("cuda@12:", when="+cuda")

    depends_on("python@3.11:", type=("build", "link", "run"))
    depends_on("py-numpy@1.24:", type="run")
    depends_on("py-scipy@1.10:", type="run")
    depends_on("py-h5py@3.7:", type="run")
    depends_on("py-matplotlib@3.6:", type="run")
    depends_on("py-pandas@1.5:", type="run")
    depends_on("pil@9:", type="run")
    depends_on("py-tomlkit@0.11:", type="run")
    depends_on("py-tqdm@4.64:", type="run")

    conflicts("%gcc@:10", msg="Moraine is C++20: GCC 11 or later")

    def config_settings(self, spec, prefix):
        switch = lambda name: "ON" if spec.satisfies(f"+{name}") else "OFF"
        return {
            "cmake.define.MORAINE_MPI": switch("mpi"),
            "cmake.define.MORAINE_CUDA": switch("cuda"),
        }

    @run_after("install")
    @on_package_attributes(run_tests=True)
    def check_installed(self):
        moraine = which(self.prefix.bin.moraine, required=True)
        moraine("cases", join_path(self.stage.path, "cases"))
        moraine("check", join_path(self.stage.path, "cases/quick-shear"))
