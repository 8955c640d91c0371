"""What the thesis printed."""

from benchmarks.thesis.tables import OtherResult, TableRow

# Rows 2 and 4 of A in Fig. A.1.
A_ROW_2 = (-519.8, -5.73, 2071.0, 0.6275, 0.0, 2.5)
A_ROW_4 = (147.9, 0.04482, -589.3, -0.3571, -0.1786, 0.0)
# The value behind the printed -5.73, recovered from the gains that were made with it.
A22_BEHIND_THE_GAINS = -5.7297

K = (75.8, 4400.9, 86.8, -1183.7, -100.0, 10.6)  # Fig. 3.4
K_FL = (13.6596, -462.0474, 214.2064, 504.4727, -211.8382, 22.2970)  # Fig. 3.8, with backlash
K_FLNO = (8.1290, 372.3904, 100.6749, 67.7136, -100.0000, 10.4449)  # Fig. 3.9, without
V_D_EXAMPLE = 4.4875  # Fig. 3.7
R = 1e-4
V_N = 1e-4
V_DNO = 1e-8
V_NNO = 1e-12

MEAN_ERROR_100_TESTS = 1.8925
MSE_100_TESTS = 9.44395e-3
MSE_TABLE = 7.443e-3
# alpha_hat = 1.0106 s^2 - 0.3855 s + 1.1906 with s = 1000 S: a fit to the table; the thesis does not print its map.
MAP_COEFFICIENTS = (1.0106, -0.3855, 1.1906)


TABLE_4_1 = (
    TableRow(1.2234, 3.624e-4, 1.183, 3.30),
    TableRow(1.7309, 8.781e-4, 1.636, 5.48),
    TableRow(2.3923, 1.287e-3, 2.354, 1.60),
    TableRow(2.5718, 1.410e-3, 2.662, 3.51),
    TableRow(3.0394, 1.600e-3, 3.164, 4.10),
    TableRow(3.6988, 1.753e-3, 3.624, 2.02),
    TableRow(4.2952, 1.926e-3, 4.196, 2.31),
    TableRow(4.7684, 2.059e-3, 4.679, 1.87),
)


OTHERS = (
    OtherResult(
        "Lagerberg and Egardt",
        "EKF-based estimators of backlash size and state",
        "0.025, 0.026, 0.027 rad against 0.024 rad by hand; spread about 5 %",
    ),
    OtherResult("Sainio", "grey-box parameter fit, two time-shifted estimators", "over 90 % fit"),
    OtherResult("Yang, Tang, Tan, Xu", "integral of the speed difference", "0.035 rad, error 5.6e-4 rad (1.6 %)"),
    OtherResult("Papageorgiou et al.", "sliding-mode observer and adaptive estimator", "< 2 s, precision 1e-3"),
    OtherResult("Dong, Tan, Tan", "pseudo-Wiener recursive identification", "largest relative error 2.62 %"),
    OtherResult("Haegglund", "automatic, from normal closed-loop operating data", "1 to 10 %"),
)
