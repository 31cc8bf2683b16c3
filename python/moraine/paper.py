"""What Damsgaard et al. (2013) report, to be held against; paragraphs, tables and figures are theirs."""

# Normal stresses of the experiments, Pa. The text gives their range (Table 1); the four between are those of Figs. 4, 8 and 9.
normal_stresses = (10e3, 20e3, 40e3, 60e3, 80e3, 120e3)

grains = 10_000

sampling = 0.05         # s between two rows of the paper's series
total_shear_strain = 1.0  # 0.738 m over the height of the bed (caption of Fig. 8)

# Mohr-Coulomb, par. 30 and Table 2: degrees, kPa; asymptotic standard errors
phi_p, phi_p_se = 32.0, 0.31
C_p, C_p_se = 1.2, 0.21
phi_u, phi_u_se = 22.0, 0.47
C_u, C_u_se = 0.51, 0.31

# Friction at 80 kPa by these lines, C/sigma_0 + tan(phi).
friction_peak_80kPa, friction_ultimate_80kPa = 0.64, 0.41

# Table 2: phi_p degrees, C_p kPa, phi_u degrees, C_u kPa
materials = {
    "quartz sand": (45, 3.7, 44, 2.4),
    "glass beads": (37, 1.8, 35, 1.5),
    "DEM (paper)": (32, 1.2, 22, 0.51),
    "till": (18, 3.1, 18, 0.69),
}

# Total dilation at 80 kPa, mean grain diameters, par. 52; the till contracts.
dilation = {"quartz sand": 2.0, "glass beads": 1.5, "DEM (paper)": 0.75}

shear_zone_10kPa = 7        # mean grain diameters, par. 33
rotation_mean = (-0.0027, 0.50, -0.0053)  # rad, 80 kPa, par. 45 (which prints rad/s)
rotation_variance = (0.76, 1.1, 0.68)     # rad^2
