"""Shears 500 grains at three normal stresses, and draws their friction and the Mohr-Coulomb line into three-stresses.png."""
import matplotlib.pyplot as plt
import moraine
from moraine import strength

case = moraine.Case("three-stresses", title="500 grains at three normal stresses")
case.box(x="35 cm", y="35 cm").grains(count=500, columns_x=8, columns_y=8, cell=1.06)
case.model(preset="fast").wall(mass="5 kg").output(series_interval="10 ms")
case.settle("0.5 s").consolidate("20 kPa", duration="0.2 s", mu_s=0.1, mu_d=0.1).shear(rate="0.1 1/s", strain=0.4)
sweep = case.sweep(normal_stress=["20 kPa", "40 kPa", "80 kPa"], resume=True)
print(sweep.table[["peak", "ultimate", "dilation_diameters"]])

figure, (left, right) = plt.subplots(1, 2, figsize=(9, 3.6), layout="constrained")
sigma, tau = sweep.table["normal_stress"] / 1e3, sweep.table["peak"] * sweep.table["normal_stress"] / 1e3  # kPa
for stress, results in zip(sigma, sweep.results):
    shear = results.stage("shear").series
    left.plot(shear["shear_strain"], strength.smoothed(shear["shear_strain"], shear["shear_friction"]), label=f"{stress:g} kPa")
fit = strength.mohr_coulomb(1e3 * sigma, 1e3 * tau)
right.plot([0, 90], fit.tau([0, 90e3]) / 1e3, label=f"φ = {fit.phi:.1f}°, C = {fit.C / 1e3:.1f} kPa")
right.plot(sigma, tau, "o", label="peaks")
left.set(xlabel="shear strain", ylabel="shear friction")
right.set(xlabel="normal stress, kPa", ylabel="shear stress, kPa", xlim=0, ylim=0)
left.legend(), right.legend()
figure.savefig("three-stresses.png", dpi=150)
