# Written by python/stubs.py from the table of keys.
from dataclasses import dataclass
from typing import Any

from .case import Case
from .run import Error

class UnknownKey(Error, AttributeError): ...

@dataclass(frozen=True)
class Key:
    name: str
    type: str
    unit: str
    default: str
    accepts: str
    meaning: str
    kinds: str
    @property
    def table(self) -> str: ...
    @property
    def leaf(self) -> str: ...
    @property
    def hint(self) -> str: ...
    @property
    def doc(self) -> str: ...
    def belongs_to(self, kind: str) -> bool: ...

keys: list[Key]
by_name: dict[str, Key]
tables: list[str]
kinds: list[str]
listed: tuple[str, ...]
carries_on: tuple[str, ...]
classes: dict[str, type[Any]]
stage_classes: dict[str, type[Any]]
def keys_of(table: str, kind: str | None = None) -> list[Key]: ...

class KeyTable:
    def __init__(self, case: Case, at: str) -> None: ...

class Box(KeyTable):
    """the box that holds the grains"""
    x: float | str
    """side along the shear direction; 0: from the lattice or `start`, or by grains.solid_fraction where z is periodic

    number in m, or text with a unit; >= 0; default 0"""
    y: float | str
    """side across; 0: from the lattice or `start`, or by grains.solid_fraction where z is periodic

    number in m, or text with a unit; >= 0; default 0"""
    z: float | str
    """height; counts only where z is periodic; 0: from `start`, or by grains.solid_fraction

    number in m, or text with a unit; >= 0; default 0"""
    periodic: str
    """periodic sides

    one of none, x, y, z, xy, xz, yz, xyz; default xy"""
    floor: bool
    """fixed wall at z = 0

    boolean; default true"""
    walls: str
    """fixed walls at both sides of an axis that is not periodic; as rough as the floor (wall.k_t, stage.wall_mu)

    one of none, x, y, xy; default none"""
    def __call__(self, *, x: float | str = ..., y: float | str = ..., z: float | str = ..., periodic: str = ..., floor: bool = ..., walls: str = ...) -> Case: ...

class Grains(KeyTable):
    """the grains at the start"""
    count: int | float | str
    """number of grains

    integer; 1 .. 2147483647; default 10000"""
    distribution: str
    """of the radii

    one of lognormal, uniform, fractal, sieves, bimodal; default lognormal"""
    radius_mean: float | str
    """lognormal: mean radius; bimodal: of the coarse grains

    number in m, or text with a unit; > 0; default 0.02"""
    radius_std: float | str
    """lognormal: standard deviation of the radius; bimodal: of the coarse grains

    number in m, or text with a unit; >= 0; default 9.38e-5"""
    fine_radius_mean: float | str
    """bimodal: mean radius of the fine grains, which are log-normal, too

    number in m, or text with a unit; >= 0; default 0"""
    fine_radius_std: float | str
    """bimodal: their standard deviation

    number in m, or text with a unit; >= 0; default 0"""
    fine_fraction: float | str
    """bimodal: their share of the mass

    number, or text with a unit; 0 .. 1; default 0"""
    radius_min: float | str
    """uniform, fractal: least radius; lognormal: smaller ones are drawn again; bimodal: there are no smaller ones

    number in m, or text with a unit; >= 0; default 0"""
    radius_max: float | str
    """uniform, fractal: largest radius; lognormal: larger ones are drawn again, bimodal: there are none, 0: no limit

    number in m, or text with a unit; >= 0; default 0"""
    fractal_dimension: float | str
    """fractal: as many grains are larger than r as r^-D; 3: the same mass at each size

    number, or text with a unit; > 0; default 2.6"""
    sieves: str
    """sieves: a CSV file with the columns size (m) and finer (1, by mass), or other units: size (mm), finer (%)

    path; default empty"""
    density: float | str
    """of the grains

    number in kg/m3, or text with a unit; > 0; default 2600"""
    material: str
    """of all grains that no [[material]] takes by size or layer; empty: there is one material only, or a table of grains says it

    text; default empty"""
    seed: int | float | str
    """of the random radii and places

    integer; >= 0; default 1"""
    placement: str
    """where grains begin: one in each cell of a lattice; or anywhere in box.x and box.y (and box.z where z is periodic), largest first

    one of lattice, random; default lattice"""
    solid_fraction: float | str
    """random: share of the space that the grains fill at first

    number, or text with a unit; 0.001 .. 0.35; default 0.25"""
    columns_x: int | float | str
    """lattice cells along x

    integer; >= 1; default 10"""
    columns_y: int | float | str
    """lattice cells along y

    integer; >= 1; default 10"""
    cell: float | str
    """side of a lattice cell in largest grain diameters

    number, or text with a unit; >= 1.05; default 2.1"""
    def __call__(self, *, count: int | float | str = ..., distribution: str = ..., radius_mean: float | str = ..., radius_std: float | str = ..., fine_radius_mean: float | str = ..., fine_radius_std: float | str = ..., fine_fraction: float | str = ..., radius_min: float | str = ..., radius_max: float | str = ..., fractal_dimension: float | str = ..., sieves: str = ..., density: float | str = ..., material: str = ..., seed: int | float | str = ..., placement: str = ..., solid_fraction: float | str = ..., columns_x: int | float | str = ..., columns_y: int | float | str = ..., cell: float | str = ...) -> Case: ...

class Contact(KeyTable):
    """contacts between grains"""
    law: str
    """linear springs k_n and k_t; or Hertz and Mindlin, of elastic spheres with young and poisson (k_n and k_t then do not count)

    one of linear, hertz; default linear"""
    k_n: float | str
    """normal stiffness of linear springs

    number in N/m, or text with a unit; > 0; default 1.16e9"""
    k_t: float | str
    """tangential stiffness of linear springs

    number in N/m, or text with a unit; >= 0; default 1.16e9"""
    young: float | str
    """hertz: Young's modulus

    number in Pa, or text with a unit; >= 0; default 0"""
    poisson: float | str
    """hertz: Poisson's ratio

    number, or text with a unit; 0 .. 0.5; default 0.25"""
    restitution: float | str
    """coefficient of restitution of two free grains, by damping of the normal direction beside gamma_n; 1: none; a stage may have its own

    number, or text with a unit; 0.05 .. 1; default 1"""
    gamma_n: float | str
    """normal viscosity; a stage may have its own

    number in N s/m, or text with a unit; >= 0; default 0"""
    gamma_t: float | str
    """tangential viscosity; a stage may have its own

    number in N s/m, or text with a unit; >= 0; default 0"""
    mu_s: float | str
    """static friction; a stage may have its own

    number, or text with a unit; >= 0; default 0.3"""
    mu_d: float | str
    """dynamic friction, at most mu_s; a stage may have its own

    number, or text with a unit; >= 0; default contact.mu_s"""
    mu_roll: float | str
    """resistance to rolling, of grains that are not round: the couple is at most mu_roll R f_n, 1/R = 1/r_i + 1/r_j; 0: none

    number, or text with a unit; >= 0; default 0"""
    k_roll: float | str
    """stiffness against rolling before that, as a force at R

    number in N/m, or text with a unit; >= 0; default contact.k_t"""
    mu_twist: float | str
    """resistance to twisting about the normal: the couple is at most mu_twist R f_n; 0: none

    number, or text with a unit; >= 0; default 0"""
    k_twist: float | str
    """stiffness against twisting before that, as a force at R

    number in N/m, or text with a unit; >= 0; default contact.k_roll"""
    cohesion: float | str
    """constant pull of grains that touch, which friction does not see

    number in N, or text with a unit; >= 0; default 0"""
    pairs: str
    """of grains of unlike materials: the geometric mean of friction, rolling, restitution and viscosity, the smaller one, or what [[pair]] says, which is then needed for all; what a [[pair]] leaves out is geometric; stiffnesses are those of two springs in series, 2 k_1 k_2/(k_1 + k_2), or Hertz's for young and poisson

    one of geometric, minimum, table; default geometric"""
    def __call__(self, *, law: str = ..., k_n: float | str = ..., k_t: float | str = ..., young: float | str = ..., poisson: float | str = ..., restitution: float | str = ..., gamma_n: float | str = ..., gamma_t: float | str = ..., mu_s: float | str = ..., mu_d: float | str = ..., mu_roll: float | str = ..., k_roll: float | str = ..., mu_twist: float | str = ..., k_twist: float | str = ..., cohesion: float | str = ..., pairs: str = ...) -> Case: ...

class Wall(KeyTable):
    """walls, and contacts with them"""
    k_t: float | str
    """tangential stiffness against walls; k_n is that of contacts

    number in N/m, or text with a unit; >= 0; default 0"""
    material: str
    """a [[material]] that floor and walls are of, so that contact.pairs says what is between them and grains, but for viscosities and for friction, which is stage.wall_mu or that of a [[pair]] with "wall"; empty: they have the keys of [wall], and the grain's k_n

    text; default empty"""
    young: float | str
    """hertz: Young's modulus of walls; slip at walls takes wall_mu

    number in Pa, or text with a unit; >= 0; default contact.young"""
    poisson: float | str
    """hertz: Poisson's ratio of walls

    number, or text with a unit; 0 .. 0.5; default contact.poisson"""
    restitution: float | str
    """coefficient of restitution against walls that do not give way, by damping beside their gamma_n; a stage may have its own

    number, or text with a unit; 0.05 .. 1; default 1"""
    mu_roll: float | str
    """resistance to rolling on walls, R = r

    number, or text with a unit; >= 0; default 0"""
    k_roll: float | str
    """stiffness against rolling on walls

    number in N/m, or text with a unit; >= 0; default contact.k_roll"""
    mu_twist: float | str
    """resistance to twisting on walls

    number, or text with a unit; >= 0; default 0"""
    k_twist: float | str
    """stiffness against twisting on walls

    number in N/m, or text with a unit; >= 0; default wall.k_roll"""
    cohesion: float | str
    """constant pull of walls on grains that touch them

    number in N, or text with a unit; >= 0; default 0"""
    mass: float | str
    """of the top wall; 0: 0.001 of the mass of N spheres as wide as a lattice cell

    number in kg, or text with a unit; >= 0; default 0"""
    gamma_n: float | str
    """normal viscosity against walls while settling and consolidating; a stage may have its own

    number in N s/m, or text with a unit; >= 0; default 1e4"""
    gamma_t: float | str
    """tangential viscosity against walls, likewise

    number in N s/m, or text with a unit; >= 0; default 1e4"""
    def __call__(self, *, k_t: float | str = ..., material: str = ..., young: float | str = ..., poisson: float | str = ..., restitution: float | str = ..., mu_roll: float | str = ..., k_roll: float | str = ..., mu_twist: float | str = ..., k_twist: float | str = ..., cohesion: float | str = ..., mass: float | str = ..., gamma_n: float | str = ..., gamma_t: float | str = ...) -> Case: ...

class Model(KeyTable):
    """gravity, time step, and what the computation costs"""
    gravity: float | str
    """along -z; see slope

    number in m/s2, or text with a unit; >= 0; default 9.80665"""
    slope: float | str
    """of the ground, falling towards +x: gravity acts along (sin, 0, -cos) of it; x stays along the bed and z at right angles to it

    number in rad, or text with a unit; -1.57 .. 1.57; default 0"""
    density_scaling: float | str
    """density scaling by size, for a longer step: radii below this have the inertia of this one, and their own weight; 0: none

    number in m, or text with a unit; >= 0; default 0"""
    preset: str
    """accuracy against time: sets f, softening and the walls' viscosity where the case does not; see below

    one of none, paper, standard, fast; default none"""
    softening: float | str
    """stiffnesses of grains and walls (k_n, k_t, young, k_roll, k_twist) are divided by it; viscosities are not

    number, or text with a unit; >= 1; default 1"""
    f: float | str
    """time step in units of sqrt(min m / max(k_n, k_t)), eq. 9; a stage may have its own

    number, or text with a unit; > 0; default 0.075"""
    dt: float | str
    """time step; 0: by f; "auto": safety times the critical step of the present contact network

    number in s, or text with a unit; >= 0 | auto; default 0"""
    safety: float | str
    """dt = "auto": share of the critical step

    number, or text with a unit; 0.01 .. 1; default 0.5"""
    neighbour_margin: float | str
    """of the neighbour list; 0: automatic; changes no result

    number in m, or text with a unit; >= 0; default 0"""
    ledger: bool
    """account for every joule

    boolean; default true"""
    def __call__(self, *, gravity: float | str = ..., slope: float | str = ..., density_scaling: float | str = ..., preset: str = ..., softening: float | str = ..., f: float | str = ..., dt: float | str = ..., safety: float | str = ..., neighbour_margin: float | str = ..., ledger: bool = ...) -> Case: ...

class Fluid(KeyTable):
    """pore water"""
    enabled: bool
    """pore water in the stages; a stage may say otherwise

    boolean; default false"""
    viscosity: float | str
    """of the water

    number in Pa s, or text with a unit; > 0; default 1.8e-3"""
    compressibility: float | str
    """of the water

    number in 1/Pa, or text with a unit; > 0; default 4.5e-10"""
    density: float | str
    """of the water, for buoyancy

    number in kg/m3, or text with a unit; > 0; default 1000"""
    permeability_factor: float | str
    """k_c of k = k_c phi^3/(1 - phi)^2; 0: d^2/180, d the Sauter mean diameter (sum of d^3 over sum of d^2) of the grains in each cell

    number in m2, or text with a unit; >= 0; default 0"""
    porosity_min: float | str
    """storage and permeability take no lower porosity

    number, or text with a unit; > 0; default 0.1"""
    porosity_max: float | str
    """nor a higher one

    number, or text with a unit; > 0; default 0.9"""
    cell: float | str
    """side of a grid cell in mean diameters, at least; below 2 it measures pores

    number, or text with a unit; > 0; default 2.5"""
    cells_x: int | float | str
    """cells of the grid along x; 0: by fluid.cell

    integer; >= 0; default 0"""
    cells_y: int | float | str
    """along y

    integer; >= 0; default 0"""
    cells_z: int | float | str
    """along z, between floor and top wall

    integer; >= 0; default 0"""
    height: float | str
    """of the grid where there is no top wall; 0: the bed and one cell

    number in m, or text with a unit; >= 0; default 0"""
    closure: str
    """force on a grain: -V/(1 - phi) grad p, or -V grad p without the drag

    one of full, pressure_gradient; default full"""
    exchange_interval: int | float | str
    """steps between exchanges of grains and water; 0: the longest that is stable

    integer; >= 0; default 0"""
    solver: str
    """for the pressure

    one of automatic, pcg, cholmod; default automatic"""
    tolerance: float | str
    """of the residual over the right-hand side (pcg)

    number, or text with a unit; 1e-15 .. 1e-6; default 1e-10"""
    x_low: str
    """the side x = 0, where x is not periodic: tight, at x_low_pressure, or with x_low_flux through it

    one of no_flow, pressure, flux; default no_flow"""
    x_low_pressure: float | str
    """over hydrostatic, at that side

    number in Pa, or text with a unit; default 0"""
    x_low_flux: float | str
    """Darcy velocity through that side, into the bed

    number in m/s, or text with a unit; default 0"""
    x_high: str
    """the side x = box.x, where x is not periodic: tight, at x_high_pressure, or with x_high_flux through it

    one of no_flow, pressure, flux; default no_flow"""
    x_high_pressure: float | str
    """over hydrostatic, at that side

    number in Pa, or text with a unit; default 0"""
    x_high_flux: float | str
    """Darcy velocity through that side, into the bed

    number in m/s, or text with a unit; default 0"""
    y_low: str
    """the side y = 0, where y is not periodic: tight, at y_low_pressure, or with y_low_flux through it

    one of no_flow, pressure, flux; default no_flow"""
    y_low_pressure: float | str
    """over hydrostatic, at that side

    number in Pa, or text with a unit; default 0"""
    y_low_flux: float | str
    """Darcy velocity through that side, into the bed

    number in m/s, or text with a unit; default 0"""
    y_high: str
    """the side y = box.y, where y is not periodic: tight, at y_high_pressure, or with y_high_flux through it

    one of no_flow, pressure, flux; default no_flow"""
    y_high_pressure: float | str
    """over hydrostatic, at that side

    number in Pa, or text with a unit; default 0"""
    y_high_flux: float | str
    """Darcy velocity through that side, into the bed

    number in m/s, or text with a unit; default 0"""
    def __call__(self, *, enabled: bool = ..., viscosity: float | str = ..., compressibility: float | str = ..., density: float | str = ..., permeability_factor: float | str = ..., porosity_min: float | str = ..., porosity_max: float | str = ..., cell: float | str = ..., cells_x: int | float | str = ..., cells_y: int | float | str = ..., cells_z: int | float | str = ..., height: float | str = ..., closure: str = ..., exchange_interval: int | float | str = ..., solver: str = ..., tolerance: float | str = ..., x_low: str = ..., x_low_pressure: float | str = ..., x_low_flux: float | str = ..., x_high: str = ..., x_high_pressure: float | str = ..., x_high_flux: float | str = ..., y_low: str = ..., y_low_pressure: float | str = ..., y_low_flux: float | str = ..., y_high: str = ..., y_high_pressure: float | str = ..., y_high_flux: float | str = ...) -> Case: ...

class Material(KeyTable):
    """a material of grains or walls"""
    name: str
    """unique; letters, digits, - and _

    text; has to be given"""
    density: float | str
    """of these grains

    number in kg/m3, or text with a unit; > 0; default grains.density"""
    sizes: list[str]
    """grains with diameters from the first of two lengths to below the second are of this material: ["1 mm", "2 cm"]

    list of texts; default empty"""
    layer: list[str]
    """grains whose centres begin at heights from the first of two lengths to below the second are of this material: ["0 m", "0.1 m"]

    list of texts; default empty"""
    k_n: float | str
    """normal stiffness of linear springs of its grains among each other, where a stage has none of its own

    number in N/m, or text with a unit; > 0; default contact.k_n"""
    k_t: float | str
    """tangential stiffness of linear springs of its grains among each other, where a stage has none of its own

    number in N/m, or text with a unit; >= 0; default contact.k_t"""
    young: float | str
    """hertz: Young's modulus of its grains among each other, where a stage has none of its own

    number in Pa, or text with a unit; >= 0; default contact.young"""
    poisson: float | str
    """hertz: Poisson's ratio of its grains among each other, where a stage has none of its own

    number, or text with a unit; 0 .. 0.5; default contact.poisson"""
    gamma_n: float | str
    """normal viscosity of its grains among each other, where a stage has none of its own

    number in N s/m, or text with a unit; >= 0; default contact.gamma_n"""
    gamma_t: float | str
    """tangential viscosity of its grains among each other, where a stage has none of its own

    number in N s/m, or text with a unit; >= 0; default contact.gamma_t"""
    mu_s: float | str
    """static friction of its grains among each other, where a stage has none of its own

    number, or text with a unit; >= 0; default contact.mu_s"""
    mu_d: float | str
    """dynamic friction of its grains among each other, where a stage has none of its own

    number, or text with a unit; >= 0; default contact.mu_d"""
    restitution: float | str
    """coefficient of restitution of two free grains, by damping of the normal direction beside gamma_n; 1: none of its grains among each other, where a stage has none of its own

    number, or text with a unit; 0.05 .. 1; default contact.restitution"""
    mu_roll: float | str
    """resistance to rolling, of grains that are not round: the couple is at most mu_roll R f_n, 1/R = 1/r_i + 1/r_j; 0: none of its grains among each other, where a stage has none of its own

    number, or text with a unit; >= 0; default contact.mu_roll"""
    k_roll: float | str
    """stiffness against rolling before that, as a force at R of its grains among each other, where a stage has none of its own

    number in N/m, or text with a unit; >= 0; default contact.k_roll"""
    mu_twist: float | str
    """resistance to twisting about the normal: the couple is at most mu_twist R f_n; 0: none of its grains among each other, where a stage has none of its own

    number, or text with a unit; >= 0; default contact.mu_twist"""
    k_twist: float | str
    """stiffness against twisting before that, as a force at R of its grains among each other, where a stage has none of its own

    number in N/m, or text with a unit; >= 0; default contact.k_twist"""
    cohesion: float | str
    """constant pull of grains that touch, which friction does not see of its grains among each other, where a stage has none of its own

    number in N, or text with a unit; >= 0; default contact.cohesion"""
    def __call__(self, *, name: str = ..., density: float | str = ..., sizes: list[str] = ..., layer: list[str] = ..., k_n: float | str = ..., k_t: float | str = ..., young: float | str = ..., poisson: float | str = ..., gamma_n: float | str = ..., gamma_t: float | str = ..., mu_s: float | str = ..., mu_d: float | str = ..., restitution: float | str = ..., mu_roll: float | str = ..., k_roll: float | str = ..., mu_twist: float | str = ..., k_twist: float | str = ..., cohesion: float | str = ...) -> Case: ...

class Pair(KeyTable):
    """two materials, one against the other"""
    of: list[str]
    """two materials, or one and "wall"

    list of texts; has to be given"""
    k_n: float | str
    """normal stiffness of linear springs between the two, where a stage has none of its own

    number in N/m, or text with a unit; > 0; default contact.pairs"""
    k_t: float | str
    """tangential stiffness of linear springs between the two, where a stage has none of its own

    number in N/m, or text with a unit; >= 0; default contact.pairs"""
    gamma_n: float | str
    """normal viscosity between the two, where a stage has none of its own

    number in N s/m, or text with a unit; >= 0; default contact.pairs"""
    gamma_t: float | str
    """tangential viscosity between the two, where a stage has none of its own

    number in N s/m, or text with a unit; >= 0; default contact.pairs"""
    mu_s: float | str
    """static friction between the two, where a stage has none of its own

    number, or text with a unit; >= 0; default contact.pairs"""
    mu_d: float | str
    """dynamic friction between the two, where a stage has none of its own

    number, or text with a unit; >= 0; default contact.pairs"""
    restitution: float | str
    """coefficient of restitution of two free grains, by damping of the normal direction beside gamma_n; 1: none between the two, where a stage has none of its own

    number, or text with a unit; 0.05 .. 1; default contact.pairs"""
    mu_roll: float | str
    """resistance to rolling, of grains that are not round: the couple is at most mu_roll R f_n, 1/R = 1/r_i + 1/r_j; 0: none between the two, where a stage has none of its own

    number, or text with a unit; >= 0; default contact.pairs"""
    k_roll: float | str
    """stiffness against rolling before that, as a force at R between the two, where a stage has none of its own

    number in N/m, or text with a unit; >= 0; default contact.pairs"""
    mu_twist: float | str
    """resistance to twisting about the normal: the couple is at most mu_twist R f_n; 0: none between the two, where a stage has none of its own

    number, or text with a unit; >= 0; default contact.pairs"""
    k_twist: float | str
    """stiffness against twisting before that, as a force at R between the two, where a stage has none of its own

    number in N/m, or text with a unit; >= 0; default contact.pairs"""
    cohesion: float | str
    """constant pull of grains that touch, which friction does not see between the two, where a stage has none of its own

    number in N, or text with a unit; >= 0; default contact.pairs"""
    def __call__(self, *, of: list[str] = ..., k_n: float | str = ..., k_t: float | str = ..., gamma_n: float | str = ..., gamma_t: float | str = ..., mu_s: float | str = ..., mu_d: float | str = ..., restitution: float | str = ..., mu_roll: float | str = ..., k_roll: float | str = ..., mu_twist: float | str = ..., k_twist: float | str = ..., cohesion: float | str = ...) -> Case: ...

class Output(KeyTable):
    """how often results are written"""
    series_interval: float | str
    """of model time

    number in s, or text with a unit; > 0; default 0.05"""
    snapshot_interval: float | str
    """of model time

    number in s, or text with a unit; > 0; default 0.5"""
    checkpoint_interval: float | str
    """of wall clock

    number in s, or text with a unit; > 0; default 60"""
    def __call__(self, *, series_interval: float | str = ..., snapshot_interval: float | str = ..., checkpoint_interval: float | str = ...) -> Case: ...

class Guards(KeyTable):
    """where a run that goes wrong is stopped"""
    interval: int | float | str
    """steps between looks at the state; the engine itself looks for lost grains every 256

    integer; >= 1; default 20000"""
    max_overlap: float | str
    """deepest overlap over the smaller radius; beyond it the run stops

    number, or text with a unit; > 0; default 0.2"""
    max_residue: float | str
    """energy created or lost over that stored and put in; beyond it the run stops

    number, or text with a unit; > 0; default 0.1"""
    def __call__(self, *, interval: int | float | str = ..., max_overlap: float | str = ..., max_residue: float | str = ...) -> Case: ...

class Stage(KeyTable):
    """a stage"""
    name: str
    """unique; letters, digits, - and _

    text; has to be given"""
    kind: str
    """what is done to the bed

    one of settle, consolidate, shear, shear_stress, uniaxial, press; has to be given"""
    duration: float | str
    """of the stage; this, strain or porosity

    number in s, or text with a unit; >= 0; default 0"""
    strain: float | str
    """where the stage ends: u t/H_0, or axial; magnitude

    number, or text with a unit; >= 0; default 0; of stages shear, uniaxial"""
    top_wall: str
    """automatic: none to settle or press, driven in uniaxial, else stress

    one of automatic, stress, fixed, none; default automatic"""
    normal_stress: float | str | dict
    """on the top wall; or a history, see below

    number in Pa, text with a unit, or history (a dict); >= 0; default 0"""
    normal_stress_amplitude: float | str
    """of a sinusoid added to normal_stress

    number in Pa, or text with a unit; default 0"""
    normal_stress_frequency: float | str
    """of that sinusoid

    number in Hz, or text with a unit; >= 0; default 0"""
    normal_stress_phase: float | str
    """of that sinusoid when the stage begins; a stage that asks for the same as the one before goes on with it

    number in rad, or text with a unit; default 0"""
    velocity: float | str | dict
    """of the top layer; this or strain_rate; or a history, see below

    number in m/s, text with a unit, or history (a dict); default 0; of stages shear"""
    velocity_amplitude: float | str
    """of a sinusoid added to velocity

    number in m/s, or text with a unit; default 0; of stages shear"""
    velocity_frequency: float | str
    """of that sinusoid

    number in Hz, or text with a unit; >= 0; default 0; of stages shear"""
    velocity_phase: float | str
    """of that sinusoid when the stage begins; a stage that asks for the same as the one before goes on with it

    number in rad, or text with a unit; default 0; of stages shear"""
    profile: str
    """of the velocity across y, times that velocity, by where a grain of the layer stands: 1; y/L; (1 - cos(2 pi y/L))/2; or 1 below L/2 and 0 beyond, L = box.y

    one of uniform, linear, cosine, half; default uniform; of stages shear"""
    strain_rate: float | str
    """velocity over H_0, the height of the bed when shear began; axial; or how fast each side of a pressed box shortens, at most

    number in 1/s, or text with a unit; default 0; of stages shear, uniaxial, press"""
    shear_stress: float | str | dict
    """that drives the top layer; or a history, see below

    number in Pa, text with a unit, or history (a dict); default 0; of stages shear_stress"""
    shear_stress_amplitude: float | str
    """of a sinusoid added to shear_stress

    number in Pa, or text with a unit; default 0; of stages shear_stress"""
    shear_stress_frequency: float | str
    """of that sinusoid

    number in Hz, or text with a unit; >= 0; default 0; of stages shear_stress"""
    shear_stress_phase: float | str
    """of that sinusoid when the stage begins; a stage that asks for the same as the one before goes on with it

    number in rad, or text with a unit; default 0; of stages shear_stress"""
    porosity: float | str
    """that a box is pressed to, all sides alike, in place of pressure; or a bed by its wall, in place of duration and strain

    number, or text with a unit; 0 .. 0.99; default 0; of stages press, uniaxial"""
    pressure: float | str
    """of the grains on the sides of the box, on each by itself, for the duration of the stage

    number in Pa, or text with a unit; >= 0; default 0; of stages press"""
    layer_mass: float | str
    """that the shear stress moves besides the layer's grains, such as that of the ice above

    number in kg, or text with a unit; >= 0; default 0; of stages shear_stress"""
    bottom_layer: float | str
    """thickness of the layer that stands still; negative: one largest diameter. A stage that shears on keeps the layers of the one before

    number in m, or text with a unit; default -1; of stages shear, shear_stress"""
    top_layer: float | str
    """thickness of the driven layer; negative: one largest diameter

    number in m, or text with a unit; default -1; of stages shear, shear_stress"""
    hold_layer_height: bool
    """the layers keep their height too

    boolean; default false; of stages shear, shear_stress"""
    f: float | str
    """time step, as model.f

    number, or text with a unit; > 0; default model.f"""
    gamma_n: float | str
    """normal viscosity

    number in N s/m, or text with a unit; >= 0; default contact.gamma_n"""
    gamma_t: float | str
    """tangential viscosity

    number in N s/m, or text with a unit; >= 0; default contact.gamma_t"""
    mu_s: float | str
    """static friction

    number, or text with a unit; >= 0; default contact.mu_s"""
    mu_d: float | str
    """dynamic friction, at most mu_s

    number, or text with a unit; >= 0; default contact.mu_d"""
    wall_gamma_n: float | str
    """normal viscosity against walls

    number in N s/m, or text with a unit; >= 0; default 0 (settle, consolidate: wall.gamma_n)"""
    wall_gamma_t: float | str
    """tangential viscosity against walls

    number in N s/m, or text with a unit; >= 0; default 0 (settle, consolidate: wall.gamma_t)"""
    restitution: float | str
    """coefficient of restitution of two grains

    number, or text with a unit; 0.05 .. 1; default contact.restitution"""
    wall_restitution: float | str
    """coefficient of restitution against walls

    number, or text with a unit; 0.05 .. 1; default wall.restitution"""
    wall_mu: float | str
    """friction against walls

    number, or text with a unit; >= 0; default 0 (settle, consolidate: stage.mu_d)"""
    zero_kinematics: bool
    """velocities, spins and rotations begin at zero; by default not where the stage before, or the last one of `start`, is of the same kind

    boolean; default true (another of its kind: false)"""
    clear_history: bool
    """tangential springs are forgotten when the stage begins

    boolean; default false"""
    fluid: bool
    """pore water in this stage

    boolean; default fluid.enabled"""
    fluid_top: str
    """the top: at top_pressure, or tight (then the wall carries the water's pressure)

    one of drained, impermeable; default drained"""
    top_pressure: float | str | dict
    """over hydrostatic, at a drained top; or a history, see below

    number in Pa, text with a unit, or history (a dict); default 0"""
    top_pressure_amplitude: float | str
    """of a sinusoid added to top_pressure

    number in Pa, or text with a unit; default 0"""
    top_pressure_frequency: float | str
    """of that sinusoid

    number in Hz, or text with a unit; >= 0; default 0"""
    top_pressure_phase: float | str
    """of that sinusoid when the stage begins; a stage that asks for the same as the one before goes on with it

    number in rad, or text with a unit; default 0"""
    fluid_bottom: str
    """the floor: tight, at bottom_pressure, or with bottom_flux through it

    one of no_flow, pressure, flux; default no_flow"""
    bottom_pressure: float | str | dict
    """over hydrostatic, at the floor; or a history, see below

    number in Pa, text with a unit, or history (a dict); default 0"""
    bottom_pressure_amplitude: float | str
    """of a sinusoid added to bottom_pressure

    number in Pa, or text with a unit; default 0"""
    bottom_pressure_frequency: float | str
    """of that sinusoid

    number in Hz, or text with a unit; >= 0; default 0"""
    bottom_pressure_phase: float | str
    """of that sinusoid when the stage begins; a stage that asks for the same as the one before goes on with it

    number in rad, or text with a unit; default 0"""
    bottom_flux: float | str
    """Darcy velocity through the floor, upwards

    number in m/s, or text with a unit; default 0"""
    def __call__(self, *, name: str = ..., kind: str = ..., duration: float | str = ..., strain: float | str = ..., top_wall: str = ..., normal_stress: float | str | dict = ..., normal_stress_amplitude: float | str = ..., normal_stress_frequency: float | str = ..., normal_stress_phase: float | str = ..., velocity: float | str | dict = ..., velocity_amplitude: float | str = ..., velocity_frequency: float | str = ..., velocity_phase: float | str = ..., profile: str = ..., strain_rate: float | str = ..., shear_stress: float | str | dict = ..., shear_stress_amplitude: float | str = ..., shear_stress_frequency: float | str = ..., shear_stress_phase: float | str = ..., porosity: float | str = ..., pressure: float | str = ..., layer_mass: float | str = ..., bottom_layer: float | str = ..., top_layer: float | str = ..., hold_layer_height: bool = ..., f: float | str = ..., gamma_n: float | str = ..., gamma_t: float | str = ..., mu_s: float | str = ..., mu_d: float | str = ..., wall_gamma_n: float | str = ..., wall_gamma_t: float | str = ..., restitution: float | str = ..., wall_restitution: float | str = ..., wall_mu: float | str = ..., zero_kinematics: bool = ..., clear_history: bool = ..., fluid: bool = ..., fluid_top: str = ..., top_pressure: float | str | dict = ..., top_pressure_amplitude: float | str = ..., top_pressure_frequency: float | str = ..., top_pressure_phase: float | str = ..., fluid_bottom: str = ..., bottom_pressure: float | str | dict = ..., bottom_pressure_amplitude: float | str = ..., bottom_pressure_frequency: float | str = ..., bottom_pressure_phase: float | str = ..., bottom_flux: float | str = ...) -> Case: ...

class CaseKeys:
    title: str
    """what the case is about

    text; default empty"""
    extends: str
    """directory of a case whose keys and stages this one takes over

    text; default empty"""
    start: str
    """where the grains come from: a finished case, a checkpoint file, a table of grains NAME.csv with the columns x, y, z, r (and vx .. vz, wx .. wz, role), a LAMMPS data file NAME.data, or a snapshot; empty: drawn, see grains

    path; default empty"""
    box: Box
    """the box that holds the grains"""
    grains: Grains
    """the grains at the start"""
    contact: Contact
    """contacts between grains"""
    wall: Wall
    """walls, and contacts with them"""
    model: Model
    """gravity, time step, and what the computation costs"""
    fluid: Fluid
    """pore water"""
    output: Output
    """how often results are written"""
    guards: Guards
    """where a run that goes wrong is stopped"""
    def settle(self, duration: float | str = ..., *, name: str = ..., top_wall: str = ..., normal_stress: float | str | dict = ..., normal_stress_amplitude: float | str = ..., normal_stress_frequency: float | str = ..., normal_stress_phase: float | str = ..., f: float | str = ..., gamma_n: float | str = ..., gamma_t: float | str = ..., mu_s: float | str = ..., mu_d: float | str = ..., wall_gamma_n: float | str = ..., wall_gamma_t: float | str = ..., restitution: float | str = ..., wall_restitution: float | str = ..., wall_mu: float | str = ..., zero_kinematics: bool = ..., clear_history: bool = ..., fluid: bool = ..., fluid_top: str = ..., top_pressure: float | str | dict = ..., top_pressure_amplitude: float | str = ..., top_pressure_frequency: float | str = ..., top_pressure_phase: float | str = ..., fluid_bottom: str = ..., bottom_pressure: float | str | dict = ..., bottom_pressure_amplitude: float | str = ..., bottom_pressure_frequency: float | str = ..., bottom_pressure_phase: float | str = ..., bottom_flux: float | str = ..., stress: float | str | dict = ...) -> Case:
        """Adds a stage of kind settle (name: of the stage, by default settle), or states one of that name anew that was read from the file. Returns the case. A number is in SI, a text has a unit. stress is short for normal_stress."""
        ...
    def consolidate(self, normal_stress: float | str | dict = ..., *, name: str = ..., duration: float | str = ..., top_wall: str = ..., normal_stress_amplitude: float | str = ..., normal_stress_frequency: float | str = ..., normal_stress_phase: float | str = ..., f: float | str = ..., gamma_n: float | str = ..., gamma_t: float | str = ..., mu_s: float | str = ..., mu_d: float | str = ..., wall_gamma_n: float | str = ..., wall_gamma_t: float | str = ..., restitution: float | str = ..., wall_restitution: float | str = ..., wall_mu: float | str = ..., zero_kinematics: bool = ..., clear_history: bool = ..., fluid: bool = ..., fluid_top: str = ..., top_pressure: float | str | dict = ..., top_pressure_amplitude: float | str = ..., top_pressure_frequency: float | str = ..., top_pressure_phase: float | str = ..., fluid_bottom: str = ..., bottom_pressure: float | str | dict = ..., bottom_pressure_amplitude: float | str = ..., bottom_pressure_frequency: float | str = ..., bottom_pressure_phase: float | str = ..., bottom_flux: float | str = ..., stress: float | str | dict = ...) -> Case:
        """Adds a stage of kind consolidate (name: of the stage, by default consolidate), or states one of that name anew that was read from the file. Returns the case. A number is in SI, a text has a unit. stress is short for normal_stress."""
        ...
    def shear(self, strain_rate: float | str = ..., *, name: str = ..., duration: float | str = ..., strain: float | str = ..., top_wall: str = ..., normal_stress: float | str | dict = ..., normal_stress_amplitude: float | str = ..., normal_stress_frequency: float | str = ..., normal_stress_phase: float | str = ..., velocity: float | str | dict = ..., velocity_amplitude: float | str = ..., velocity_frequency: float | str = ..., velocity_phase: float | str = ..., profile: str = ..., bottom_layer: float | str = ..., top_layer: float | str = ..., hold_layer_height: bool = ..., f: float | str = ..., gamma_n: float | str = ..., gamma_t: float | str = ..., mu_s: float | str = ..., mu_d: float | str = ..., wall_gamma_n: float | str = ..., wall_gamma_t: float | str = ..., restitution: float | str = ..., wall_restitution: float | str = ..., wall_mu: float | str = ..., zero_kinematics: bool = ..., clear_history: bool = ..., fluid: bool = ..., fluid_top: str = ..., top_pressure: float | str | dict = ..., top_pressure_amplitude: float | str = ..., top_pressure_frequency: float | str = ..., top_pressure_phase: float | str = ..., fluid_bottom: str = ..., bottom_pressure: float | str | dict = ..., bottom_pressure_amplitude: float | str = ..., bottom_pressure_frequency: float | str = ..., bottom_pressure_phase: float | str = ..., bottom_flux: float | str = ..., rate: float | str = ..., stress: float | str | dict = ...) -> Case:
        """Adds a stage of kind shear (name: of the stage, by default shear), or states one of that name anew that was read from the file. Returns the case. A number is in SI, a text has a unit. rate is short for strain_rate. stress is short for normal_stress. Without normal_stress it keeps that of the stage before."""
        ...
    def shear_stress(self, shear_stress: float | str | dict = ..., *, name: str = ..., duration: float | str = ..., top_wall: str = ..., normal_stress: float | str | dict = ..., normal_stress_amplitude: float | str = ..., normal_stress_frequency: float | str = ..., normal_stress_phase: float | str = ..., shear_stress_amplitude: float | str = ..., shear_stress_frequency: float | str = ..., shear_stress_phase: float | str = ..., layer_mass: float | str = ..., bottom_layer: float | str = ..., top_layer: float | str = ..., hold_layer_height: bool = ..., f: float | str = ..., gamma_n: float | str = ..., gamma_t: float | str = ..., mu_s: float | str = ..., mu_d: float | str = ..., wall_gamma_n: float | str = ..., wall_gamma_t: float | str = ..., restitution: float | str = ..., wall_restitution: float | str = ..., wall_mu: float | str = ..., zero_kinematics: bool = ..., clear_history: bool = ..., fluid: bool = ..., fluid_top: str = ..., top_pressure: float | str | dict = ..., top_pressure_amplitude: float | str = ..., top_pressure_frequency: float | str = ..., top_pressure_phase: float | str = ..., fluid_bottom: str = ..., bottom_pressure: float | str | dict = ..., bottom_pressure_amplitude: float | str = ..., bottom_pressure_frequency: float | str = ..., bottom_pressure_phase: float | str = ..., bottom_flux: float | str = ...) -> Case:
        """Adds a stage of kind shear_stress (name: of the stage, by default shear_stress), or states one of that name anew that was read from the file. Returns the case. A number is in SI, a text has a unit. Without normal_stress it keeps that of the stage before."""
        ...
    def uniaxial(self, strain_rate: float | str = ..., *, name: str = ..., duration: float | str = ..., strain: float | str = ..., top_wall: str = ..., normal_stress: float | str | dict = ..., normal_stress_amplitude: float | str = ..., normal_stress_frequency: float | str = ..., normal_stress_phase: float | str = ..., porosity: float | str = ..., f: float | str = ..., gamma_n: float | str = ..., gamma_t: float | str = ..., mu_s: float | str = ..., mu_d: float | str = ..., wall_gamma_n: float | str = ..., wall_gamma_t: float | str = ..., restitution: float | str = ..., wall_restitution: float | str = ..., wall_mu: float | str = ..., zero_kinematics: bool = ..., clear_history: bool = ..., fluid: bool = ..., fluid_top: str = ..., top_pressure: float | str | dict = ..., top_pressure_amplitude: float | str = ..., top_pressure_frequency: float | str = ..., top_pressure_phase: float | str = ..., fluid_bottom: str = ..., bottom_pressure: float | str | dict = ..., bottom_pressure_amplitude: float | str = ..., bottom_pressure_frequency: float | str = ..., bottom_pressure_phase: float | str = ..., bottom_flux: float | str = ..., rate: float | str = ..., stress: float | str | dict = ...) -> Case:
        """Adds a stage of kind uniaxial (name: of the stage, by default uniaxial), or states one of that name anew that was read from the file. Returns the case. A number is in SI, a text has a unit. rate is short for strain_rate. stress is short for normal_stress."""
        ...
    def press(self, pressure: float | str = ..., *, name: str = ..., duration: float | str = ..., top_wall: str = ..., normal_stress: float | str | dict = ..., normal_stress_amplitude: float | str = ..., normal_stress_frequency: float | str = ..., normal_stress_phase: float | str = ..., strain_rate: float | str = ..., porosity: float | str = ..., f: float | str = ..., gamma_n: float | str = ..., gamma_t: float | str = ..., mu_s: float | str = ..., mu_d: float | str = ..., wall_gamma_n: float | str = ..., wall_gamma_t: float | str = ..., restitution: float | str = ..., wall_restitution: float | str = ..., wall_mu: float | str = ..., zero_kinematics: bool = ..., clear_history: bool = ..., fluid: bool = ..., fluid_top: str = ..., top_pressure: float | str | dict = ..., top_pressure_amplitude: float | str = ..., top_pressure_frequency: float | str = ..., top_pressure_phase: float | str = ..., fluid_bottom: str = ..., bottom_pressure: float | str | dict = ..., bottom_pressure_amplitude: float | str = ..., bottom_pressure_frequency: float | str = ..., bottom_pressure_phase: float | str = ..., bottom_flux: float | str = ..., rate: float | str = ..., stress: float | str | dict = ...) -> Case:
        """Adds a stage of kind press (name: of the stage, by default press), or states one of that name anew that was read from the file. Returns the case. A number is in SI, a text has a unit. rate is short for strain_rate. stress is short for normal_stress."""
        ...
